#!/usr/bin/env bash
# Installs packages, builds regrade and makes a styled film.
#   quickstart.sh                              styles a synthetic capture with assets/style_sunset.png
#   quickstart.sh PHOTOS STYLE [OPTIONS...]    styles a folder of photographs with a picture; OPTIONS are those of
#                                              `regrade run`
# Results are in ./regrade_NAME/, named after the photos' folder; --out names another one. Builds for the GPU, too,
# where nvcc and a card are found (REGRADE_CUDA=ON or OFF decides it). Asks before it installs packages. Exit status:
# that of the step that failed.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
if [[ "${1:-}" == --help ]]; then
  sed -n '2,9s/^# \{0,1\}//p' "${BASH_SOURCE[0]}"
  exit 0
fi
if [[ $# -eq 1 || "${1:-}" == -* || "${2:-}" == -* ]]; then
  echo "usage: quickstart.sh [PHOTOS STYLE [OPTIONS...]]" >&2
  exit 2
fi
if [[ $# -ge 2 && ! -e $1 ]]; then
  echo "there is no $1" >&2
  exit 3
fi

"$root/scripts/install_packages.sh" --ask
cuda=${REGRADE_CUDA:-OFF}
if [[ -z ${REGRADE_CUDA:-} ]] && command -v nvcc >/dev/null && nvidia-smi -L 2>/dev/null | grep -q GPU; then
  cuda=AUTO
fi
build=$root/build/cpu batches=ON
[[ $cuda == OFF ]] || build=$root/build/quickstart-cuda batches=OFF
cmake -S "$root" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DREGRADE_CUDA="$cuda" -DREGRADE_BATCHES=$batches \
  >/dev/null
cmake --build "$build" --target regrade --parallel "$(nproc)"
regrade=$build/pipeline/regrade

if [[ $# -ge 2 ]]; then
  photos=$1 style=$2
  shift 2
  name=$(basename "$(cd "$(dirname "$photos")" && pwd)/$(basename "$photos")")
else
  capture=$root/build/quickstart/capture
  [[ -d $capture/images ]] || "$regrade" synth "$capture" --scene table
  photos=$capture/images style=$root/assets/style_sunset.png name=demo
fi
out=$PWD/regrade_$name
given=("$@")
for ((i = 0; i < ${#given[@]}; ++i)); do
  case ${given[i]} in
    --out) out=${given[i + 1]:-} ;;
    --out=*) out=${given[i]#--out=} ;;
  esac
done
options=(--preset draft)
[[ " $* " == *" --preset"* ]] && options=()
[[ " $* " == *" --out"* ]] || options+=(--out "$out")

"$regrade" run "$photos" --style "$style" "${options[@]}" "$@"

# As a shell reads it back.
for name in regrade photos style out build; do printf -v "$name" '%q' "${!name}"; done
cat <<END

To go on, for example:
  $regrade stylize $out --style ANOTHER_PICTURE      another style of the same scene
  $regrade run $photos --style $style --preset standard --out ${out}_standard      finer and larger
  sudo cmake --install $build      makes \`regrade\` a command, with its man page
END
