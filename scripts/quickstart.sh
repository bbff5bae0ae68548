#!/usr/bin/env bash
# From a fresh checkout to a styled film.
#   quickstart.sh                 makes a synthetic capture and styles it with a picture of ours
#   quickstart.sh PHOTOS STYLE    styles a folder of photographs with a picture
# Results are in regrade_out/ of the folder it is started in, those of the synthetic capture in regrade_demo/. The build is for the CPU; with REGRADE_CUDA=AUTO in the
# environment it also builds for the GPU if nvcc is found, which takes minutes longer.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
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
