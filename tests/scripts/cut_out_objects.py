#!/usr/bin/env python3
"""Makes the photos of a synthetic capture transparent outside of its objects.

    regrade synth CAPTURE --scene table --views 60 --size 320x320
    cut_out_objects.py CAPTURE FOLDER

FOLDER gets the pictures and transforms.json. What is kept is more than 1 cm above the ground and less than 1.4 m from the
middle, by the exact depths of CAPTURE/truth/depth. Needs numpy and ImageMagick's `convert`.
"""
import argparse
import json
import pathlib
import subprocess

import numpy as np


def objects_of(depth, lens, world_from_camera):
    """True where a pixel's point (depth along the optical axis, world units) belongs to an object."""
    rows, columns = np.indices(depth.shape)
    points = np.stack([(columns + 0.5 - lens["cx"]) / lens["fl_x"] * depth,
                       -(rows + 0.5 - lens["cy"]) / lens["fl_y"] * depth, -depth, np.ones_like(depth)], -1)
    x, y, z = np.moveaxis((points @ np.asarray(world_from_camera).T)[..., :3], -1, 0)
    return np.isfinite(depth) & (depth > 0) & (z > 0.01) & (x * x + y * y < 1.4 ** 2)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path)
    args = parser.parse_args()
    lens = json.loads((args.capture / "truth/transforms.json").read_text())
    (args.folder / "images").mkdir(parents=True, exist_ok=True)
    for frame in lens["frames"]:
        name = pathlib.Path(frame["file_path"]).name
        depth = np.load(args.capture / "truth/depth" / (pathlib.Path(name).stem + ".npy"))
        mask = 255 * objects_of(depth, lens, frame["transform_matrix"]).astype(np.uint8)
        header = b"P5 %d %d 255\n" % (mask.shape[1], mask.shape[0])
        subprocess.run(["convert", args.capture / "images" / name, "pgm:-", "-alpha", "off", "-compose", "CopyOpacity",
                        "-composite", args.folder / "images" / name], input=header + mask.tobytes(), check=True)
        frame["file_path"] = f"images/{name}"
    (args.folder / "transforms.json").write_text(json.dumps(lens, indent=1))


if __name__ == "__main__":
    main()
