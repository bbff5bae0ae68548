#!/usr/bin/env bash
# Installs packages, builds regrade and makes a styled film.
#   quickstart.sh                 styles a synthetic capture with assets/style_sunset.png; results in ./regrade_demo/
#   quickstart.sh PHOTOS STYLE    styles a folder of photographs with a picture; results in ./regrade_out/
# Builds for the CPU; with REGRADE_CUDA=AUTO in the environment also for the GPU if nvcc is found, which takes minutes
# longer. Exit status: that of the step that failed.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
if [[ "${1:-}" == --help ]]; then
  sed -n '2,6s/^# \{0,1\}//p' "${BASH_SOURCE[0]}"
  exit 0
fi
if [[ $# -ne 0 && $# -ne 2 ]]; then
  echo "usage: quickstart.sh [PHOTOS STYLE]" >&2
  exit 2
fi
cuda=${REGRADE_CUDA:-OFF}
build=$root/build/cpu
[[ $cuda == OFF ]] || build=$root/build/quickstart-cuda

"$root/scripts/install_packages.sh"
cmake -S "$root" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DREGRADE_CUDA="$cuda" >/dev/null
cmake --build "$build" --target regrade --parallel "$(nproc)"
regrade=$build/pipeline/regrade

if [[ $# -eq 2 ]]; then
  photos=$1 style=$2 out=$PWD/regrade_out
else
  capture=$root/build/quickstart/capture
  [[ -d $capture/images ]] || "$regrade" synth "$capture" --scene table
  photos=$capture/images style=$root/assets/style_sunset.png out=$PWD/regrade_demo
fi

"$regrade" run "$photos" --style "$style" --out "$out" --preset draft

echo
echo "film:    $out/styled.mp4"
echo "report:  $out/report.html"
python3 "$root/scripts/print_headline.py" "$out/report.json"
