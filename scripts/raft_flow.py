#!/usr/bin/env python3
"""Writes RAFT's motion between frames as .flo files for `regrade evaluate --flow files:DIR`.

  raft_flow.py --frames DIR --out DIR [--gaps 1,5] [--weights NAME|FILE] [--updates 20] [--device cpu|cuda]

Needs numpy, Pillow, torch and torchvision, whose RAFT (large) it runs. --weights names weights of torchvision's, which
it fetches: C_T_V1, the default, are those of RAFT's authors trained on FlyingChairs and FlyingThings3D. A FILE holds
a state dictionary of the same network. Frames are pictures in natural order, of one size; sides are padded to multiples
of 8, the border repeated on both sides, and to 128 at least. For each pair of --gaps OUT gets
00000_00001.flo and the way back 00001_00000.flo; files that are there are kept. For frames of a run, DIR is
styles/NAME/frames/source. Exit status: 0, or 1 if frames or network are missing.
"""

import argparse
import os
import re
import struct
import sys

import numpy

MULTIPLE, LEAST_SIDE = 8, 128  # of the sides that the network takes


def natural_order(name):
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]


def read_frame(path):
    """[height, width, 3], values from 0 to 255."""
    from PIL import Image  # pylint: disable=import-outside-toplevel
    with Image.open(path) as picture:
        return numpy.asarray(picture.convert("RGB"), numpy.float32)


def padding(side):
    """(before, after): pixels added to a side."""
    extra = max(LEAST_SIDE, -(-side // MULTIPLE) * MULTIPLE) - side
    return extra // 2, extra - extra // 2


def padded(frame):
    return numpy.pad(frame, [padding(frame.shape[0]), padding(frame.shape[1]), (0, 0)], mode="edge")


def cropped(flow, height, width):
    top, left = padding(height)[0], padding(width)[0]
    return flow[top:top + height, left:left + width]


def write_flow(path, flow):
    """Middlebury's .flo; under another name until it is complete."""
    height, width = flow.shape[:2]
    with open(path + ".part", "wb") as file:
        file.write(struct.pack("<fii", 202021.25, width, height) + flow.astype("<f4").tobytes())
    os.replace(path + ".part", path)


class Raft:
    """Motion between two padded frames."""

    def __init__(self, weights, updates, device):
        import torch  # pylint: disable=import-outside-toplevel
        from torchvision.models.optical_flow import raft_large  # pylint: disable=import-outside-toplevel
        self.torch, self.updates, self.device = torch, updates, device
        self.network = raft_large(weights=None if os.path.exists(weights) else weights)
        if os.path.exists(weights):
            self.network.load_state_dict(torch.load(weights, map_location="cpu"))
        self.network = self.network.eval().to(device)

    def tensor(self, frame):
        """[1, 3, height, width], values from -1 to 1."""
        values = numpy.ascontiguousarray((frame / 127.5 - 1).transpose(2, 0, 1)[None], numpy.float32)
        return self.torch.from_numpy(values).to(self.device)

    def flow(self, first, second):
        with self.torch.no_grad():
            refined = self.network(self.tensor(first), self.tensor(second), num_flow_updates=self.updates)
        return refined[-1][0].cpu().numpy().transpose(1, 2, 0)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", required=True, metavar="DIR", help="the frames before styling")
    parser.add_argument("--out", required=True, metavar="DIR", help="the folder of .flo files")
    parser.add_argument("--gaps", default="1,5", help="distances between compared frames (1,5)")
    parser.add_argument("--weights", default="C_T_V1", help="torchvision's name, or a file (C_T_V1)")
    parser.add_argument("--updates", type=int, default=20, help="refinements of the motion (20, as RAFT's demonstration)")
    parser.add_argument("--device", default="cpu", help="torch's name of the processor (cpu)")
    options = parser.parse_args()
    names = sorted((name for name in os.listdir(options.frames)
                    if name.lower().endswith((".png", ".jpg", ".jpeg", ".ppm"))), key=natural_order)
    if len(names) < 2:
        sys.exit(f"{options.frames}: fewer than two frames")
    try:
        raft = Raft(options.weights, options.updates, options.device)
    except ImportError as error:
        sys.exit(f"{error}: install torch and torchvision, or give another program's .flo files to --flow files:DIR")
    os.makedirs(options.out, exist_ok=True)
    pairs = [(i, i + gap) for gap in map(int, options.gaps.split(",")) for i in range(len(names) - gap)]
    for i, j in pairs:
        files = [os.path.join(options.out, f"{a:05d}_{b:05d}.flo") for a, b in ((i, j), (j, i))]
        if all(os.path.exists(file) for file in files):
            continue
        frames = [read_frame(os.path.join(options.frames, names[k])) for k in (i, j)]
        height, width = frames[0].shape[:2]
        if frames[1].shape != frames[0].shape:
            sys.exit(f"{names[i]} and {names[j]} differ in size")
        frames = [padded(frame) for frame in frames]
        for file, (first, second) in zip(files, (frames, frames[::-1])):
            write_flow(file, cropped(raft.flow(first, second), height, width))
        print(f"{names[i]} to {names[j]}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
