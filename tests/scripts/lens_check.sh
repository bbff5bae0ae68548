#!/bin/sh
# Prints the held-out PSNR of the same synthetic scene through a pinhole, a strong barrel and a fisheye lens, with given poses.
#
#   tests/scripts/lens_check.sh REGRADE FOLDER ["OPTIONS OF synth" ["OPTIONS OF reconstruct"]]
#
# Barrel and fisheye should be within half a decibel of the pinhole. Exit status: 0, or that of the command that failed.
set -eu
if [ $# -lt 2 ] || [ "$1" = --help ]; then
  sed -n '2,6s/^# \{0,1\}//p' "$0"
  if [ "${1:-}" = --help ]; then exit 0; else exit 2; fi
fi
regrade=$1 folder=$2
synth=${3:---scene table --views 24 --size 640x480}
reconstruct=${4:---preset draft}
mkdir -p "$folder"
for lens in pinhole barrel fisheye; do
  effects=""
  [ $lens = pinhole ] || effects="--effects $lens"
  # shellcheck disable=SC2086
  "$regrade" synth "$folder/$lens" $synth $effects > "$folder/$lens.log" 2>&1
  # shellcheck disable=SC2086
  "$regrade" reconstruct "$folder/$lens/truth" $reconstruct --out "$folder/$lens.out" >> "$folder/$lens.log" 2>&1
  python3 -c "
import json, sys
metrics = json.load(open(sys.argv[1]))['metrics']
print(f'{sys.argv[2]:8} {metrics[\"psnr_heldout_db\"]:.2f} dB held out')" \
    "$folder/$lens.out/.regrade/stages/reconstruct.json" $lens
done
