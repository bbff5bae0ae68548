#!/bin/sh
# Edits one photo of a scene as a photographer would, by recipes for ImageMagick, and lets the scene follow:
#
#   real_edits.sh REGRADE DIR PHOTO WORK [OPTION...]
#
# DIR is the folder of a run, PHOTO the file of one of its photos, WORK a new folder. OPTIONs go to `regrade retouch`.
# Makes the styles curves, split, sky and hue of DIR, and WORK/sheet.png with the edits in front of the scene in each;
# prints a line for each edit: decibels of the photo's view in the styled scene to the edit, those of the unstyled
# scene to the photo, and what the program found. Where the second is low, so is the first: it is the scene's own error.
set -eu
if [ $# -lt 4 ] || [ "$1" = --help ]; then
  sed -n 's/^# \{0,1\}//p' "$0" | sed 1d
  [ "${1:-}" = --help ] && exit 0 || exit 2
fi
regrade=$1 dir=$2 photo=$3 work=$4
shift 4
magick=$(command -v convert)
compare=$(command -v compare)
name=$(basename "$photo")
mkdir -p "$work"
size=$("$magick" "$photo" -auto-orient -format %wx%h info:)

# A contrast curve.
"$magick" "$photo" -auto-orient -sigmoidal-contrast 4,45% "$work/curves.png"
# Split toning: blue shadows, yellow lights, and a curve for red.
"$magick" "$photo" -auto-orient -channel R -sigmoidal-contrast 3,50% -channel B +level 12%,86% +channel "$work/split.png"
# A graduated filter over the sky: dark blue at the top, nothing from the middle down.
"$magick" "$photo" -auto-orient \( -size "$size" gradient:'#7890d0-#ffffff' -level 0,55% \) -compose Multiply -composite \
  "$work/sky.png"
# One hue, from yellow to green, turned towards blue; other hues stay.
"$magick" "$photo" -auto-orient \( -clone 0 -modulate 100,110,140 \) \
  \( -clone 0 -colorspace HSL -channel R -separate +channel -write mpr:hue +delete \
     \( mpr:hue -threshold 10% \) \( mpr:hue -threshold 42% -negate \) -compose Multiply -composite -blur 0x2 \) \
  -compose Over -composite "$work/hue.png"

index=$(ls "$dir/poses/photos" >/dev/null 2>&1 && sed -n 's/.*"file": "\([^"]*\)".*/\1/p' "$dir/poses/photos.json" |
        awk -v n="$name" '{ sub(".*/", "") } $0 == n { print NR - 1; exit }')
frame=$(printf %05d.png "${index:-0}")
decibels() {
  "$magick" "$2" -resize "$("$magick" "$1" -format '%wx%h!' info:)" "$work/fitted.png"
  "$compare" -metric PSNR "$1" "$work/fitted.png" null: 2>&1 || true
}
"$magick" "$photo" -auto-orient "$work/photo.png"
echo "| edit | styled scene to the edit, dB | scene to the photo, dB | what was found |"
echo "|---|---|---|---|"
for edit in curves split sky hue; do
  said=$("$regrade" retouch "$dir" --photo "$name" --edited "$work/$edit.png" --name "$edit" --until render "$@" 2>&1)
  frames="$dir/styles/$edit/frames"
  echo "| $edit | $(decibels "$frames/styled/$frame" "$work/$edit.png") |" \
    "$(decibels "$frames/source/$frame" "$work/photo.png") |" \
    "$(echo "$said" | grep -E '^the edit (is|depends)' | cut -c1-90) |"
done
"$regrade" contact-sheet "$dir" curves split sky hue --views 3 --size 240 --out "$work/scene.png"
"$magick" \( "$work/photo.png" "$work/curves.png" "$work/split.png" "$work/sky.png" "$work/hue.png" -resize 240x +append \) \
  "$work/scene.png" -append "$work/sheet.png"
