#!/usr/bin/env python3
"""Compares a film with the same frames given as pictures: photos placed, and held-out PSNR.

  film_against_photos.py REGRADE WALK_CLIP [--work DIR] [--frames 180] [--preset draft]

WALK_CLIP (tests/support/walk_clip.cc) makes a hand-held walk through the synthetic still life, with motion blur and shake:
a film, and its frames as PNG files. Then `regrade reconstruct` runs on the film, and on the pictures of the frames that it
picked. Takes about 12 minutes on two cores. Prints a table. Exit status: 0, or 1 if the film is more than 0.5 dB worse or
has fewer of its frames placed than 95 %.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile

FRAMES_PER_SECOND = 30  # of walk_clip
WORST_DB, LEAST_PLACED = 0.5, 0.95


def reconstruct(regrade, source, out, preset):
    """Metrics of a reconstruction."""
    if not os.path.isfile(os.path.join(out, ".regrade/stages/reconstruct.json")):
        subprocess.run([regrade, "reconstruct", source, "--out", out, "--preset", preset], check=True)
    found = {}
    for stage in ("pose", "reconstruct"):
        with open(os.path.join(out, f".regrade/stages/{stage}.json"), encoding="utf-8") as file:
            found.update(json.load(file)["metrics"])
    return found


def picked_frames(out):
    """Numbers of the frames that were picked of the film."""
    with open(os.path.join(out, "poses/photos.json"), encoding="utf-8") as file:
        names = [photo["file"] for photo in json.load(file)["photos"]]
    return [round(float(re.search(r"/([\d.]+)s\.png$", name).group(1)) * FRAMES_PER_SECOND) for name in names]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("regrade")
    parser.add_argument("walk_clip")
    parser.add_argument("--work", help="folder to keep the results in; runs that are done there are not repeated")
    parser.add_argument("--frames", default="180")
    parser.add_argument("--preset", default="draft")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        work = arguments.work or scratch
        if not os.path.isfile(os.path.join(work, "walk.mp4")):
            subprocess.run([arguments.walk_clip, work, arguments.frames], check=True)
        film = reconstruct(arguments.regrade, os.path.join(work, "walk.mp4"), os.path.join(work, "of_film"), arguments.preset)
        picked = picked_frames(os.path.join(work, "of_film"))
        pictures = os.path.join(work, "pictures")
        os.makedirs(pictures, exist_ok=True)
        for frame in picked:
            shutil.copy(os.path.join(work, f"frames/{frame:05d}.png"), pictures)
        photos = reconstruct(arguments.regrade, pictures, os.path.join(work, "of_pictures"), arguments.preset)
        print("| given as | photos placed | reprojection error | held-out PSNR |\n|---|---|---|---|")
        for name, row in (("film", film), ("pictures of the same frames", photos)):
            print(f"| {name} | {row['registered']} of {len(picked)} | {row['reprojection_px']:.2f} px | {row['psnr_heldout_db']:.2f} dB |")
        worse = photos["psnr_heldout_db"] - film["psnr_heldout_db"]
        return 1 if worse > WORST_DB or film["registered"] < LEAST_PLACED * len(picked) else 0


if __name__ == "__main__":
    sys.exit(main())
