#!/bin/sh
# The same synthetic scene through a pinhole, a strong barrel and a fisheye, poses given: held-out PSNR of each.
# Lenses that bend should be within half a decibel of the pinhole.
#
#   scripts/lens_check.sh REGRADE FOLDER ["OPTIONS OF synth" ["OPTIONS OF reconstruct"]]
set -eu
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
figures = json.load(open(sys.argv[1]))['figures']
print(f'{sys.argv[2]:8} {figures[\"psnr_heldout_db\"]:.2f} dB held out')" \
    "$folder/$lens.out/.regrade/stages/reconstruct.json" $lens
done
