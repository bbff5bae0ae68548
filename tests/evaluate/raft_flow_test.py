#!/usr/bin/env python3
"""Runs scripts/raft_flow.py with stand-ins for torch and torchvision, and evaluates by the files that it writes.

  raft_flow_test.py REGRADE      exit status 77 (skipped) without numpy or Pillow

The stand-in network finds the shift of two padded frames by trying all of them. The frames are a picture that moves by
whole pixels, so the right files make it almost perfectly consistent, and flow of the wrong sign, order or place does not.
"""

import json
import os
import subprocess
import sys
import tempfile

from reference_evaluator_test import numpy, run, write_png

try:
    import PIL  # noqa: F401
except ImportError:
    print("SKIPPED: Pillow is missing (Debian: python3-pil)")
    sys.exit(77)

SCRIPT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "raft_flow.py")
WIDTH, HEIGHT, FRAMES = 150, 101, 4  # the width is padded to a multiple of 8, the height to 128
STEP = (3, -2)  # pixels right and down from frame to frame
TORCH = '''
import contextlib
import numpy
class Tensor(numpy.ndarray):
    def to(self, device):
        assert device == "cpu", device
        return self
    def cpu(self):
        return self
    def numpy(self):
        return numpy.asarray(self)
def from_numpy(values):
    return values.view(Tensor)
def load(path, map_location):
    return {"path": path}
no_grad = contextlib.nullcontext
'''
NETWORK = '''
import numpy
from torch import from_numpy
REACH = 16
class Network:
    def __init__(self, weights):
        self.weights = weights
    def load_state_dict(self, state):
        self.weights = state["path"]
    def eval(self):
        return self
    def to(self, device):
        return self
    def __call__(self, first, second, num_flow_updates):
        assert self.weights and num_flow_updates == 20, (self.weights, num_flow_updates)
        for batch in (first, second):
            assert batch.shape[:2] == (1, 3) and batch.dtype == numpy.float32, batch.shape
            assert batch.shape[2] % 8 == 0 and batch.shape[3] % 8 == 0 and min(batch.shape[2:]) >= 128, batch.shape
            assert -1 <= batch.min() < -0.2 and 0.2 < batch.max() <= 1, (batch.min(), batch.max())
        a, b = numpy.asarray(first[0, 0]), numpy.asarray(second[0, 0])
        inside = a[REACH:-REACH, REACH:-REACH]
        errors = {(u, v): abs(b[REACH + v:b.shape[0] - REACH + v, REACH + u:b.shape[1] - REACH + u] - inside).mean()
                  for u in range(-REACH + 1, REACH) for v in range(-REACH + 1, REACH)}
        u, v = min(errors, key=errors.get)
        coarse = numpy.zeros((1, 2) + a.shape, numpy.float32)
        return [from_numpy(coarse), from_numpy(coarse + numpy.array([u, v], numpy.float32)[None, :, None, None])]
def raft_large(weights):
    return Network(weights)
'''


def make_frames(folder):
    os.makedirs(folder)
    random = numpy.random.default_rng(2)
    y, x = numpy.mgrid[0:HEIGHT + 40, 0:WIDTH + 40]
    world = 127 + 60 * numpy.sin(0.31 * x + 0.13 * y) + 50 * numpy.sin(0.07 * x - 0.23 * y) + random.normal(0, 8, x.shape)
    for i in range(FRAMES):
        left, top = 20 - STEP[0] * i, 20 - STEP[1] * i
        grey = numpy.clip(world[top:top + HEIGHT, left:left + WIDTH], 0, 255).astype(numpy.uint8)
        write_png(os.path.join(folder, f"{i:05d}.png"), numpy.stack([grey] * 3, axis=2))


def write(path, text):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "w") as file:
        file.write(text)


def read_flow(path):
    values = numpy.fromfile(path, "<f4", offset=12)
    return values.reshape(HEIGHT, WIDTH, 2)


def check_sides():
    """What is padded and cropped again is what it was, and sides are those that the network takes."""
    sys.path.insert(0, os.path.dirname(SCRIPT))
    from raft_flow import cropped, padded  # pylint: disable=import-outside-toplevel
    random = numpy.random.default_rng(3)
    for height, width in ((101, 150), (128, 136), (200, 129), (127, 333)):
        frame = random.random((height, width, 3))
        wide = padded(frame)
        assert wide.shape[0] % 8 == 0 and wide.shape[1] % 8 == 0 and min(wide.shape[:2]) >= 128, wide.shape
        assert (cropped(wide, height, width) == frame).all(), (height, width)


def main():
    check_sides()
    regrade = os.path.abspath(sys.argv[1])
    with tempfile.TemporaryDirectory() as work:
        frames, out = os.path.join(work, "frames"), os.path.join(work, "flow")
        make_frames(frames)
        for name, text in (("torch", TORCH), ("torchvision", ""), ("torchvision/models", ""),
                           ("torchvision/models/optical_flow", NETWORK)):
            write(os.path.join(work, "modules", name, "__init__.py"), text)
        write(os.path.join(work, "weights.pth"), "weights")
        environment = {**os.environ, "PYTHONPATH": os.path.join(work, "modules")}

        def script(*more, modules=True):
            return subprocess.run([sys.executable, SCRIPT, "--frames", frames, "--out", out, *more], text=True, check=False,
                                  env=environment if modules else {**os.environ, "PYTHONPATH": work + "/none"},
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT)

        for gaps, weights in (("1", "C_T_V1"), ("1,2", os.path.join(work, "weights.pth"))):
            done = script("--gaps", gaps, "--weights", weights)
            assert done.returncode == 0, done.stdout
        assert done.stdout.splitlines() == ["00000.png to 00002.png", "00001.png to 00003.png"], done.stdout  # what was new
        names = {f"{a:05d}_{b:05d}.flo" for a in range(FRAMES) for b in range(FRAMES) if 1 <= abs(a - b) <= 2}
        assert set(os.listdir(out)) == names, os.listdir(out)
        for name in names:
            gap = int(name[6:11]) - int(name[:5])
            flow = read_flow(os.path.join(out, name))
            assert (flow == numpy.array(STEP) * gap).all(), (name, flow[0, 0])
        report = os.path.join(work, "report")
        run([regrade, "evaluate", "--frames", frames, "--reference", frames, "--flow", "files:" + out, "--mode", "ruder2016",
             "--gaps", "1,2", "--warp", "earlier", "--out", report])
        with open(os.path.join(report, "report.json"), encoding="utf-8") as file:
            rows = json.load(file)["consistency"]
        for row in rows:
            # Frames and motion are exact: all pairs are identical, and there is no finite mean.
            assert row["tc_psnr_mean_db"] is None and row["pairs"] > 0 and row["coverage"] > 0.8, row
        missing = script("--gaps", "3", modules=False)
        assert missing.returncode == 1 and "torch" in missing.stdout, missing.stdout
        os.remove(os.path.join(frames, "00001.png"))
        write_png(os.path.join(frames, "00001.png"), numpy.zeros((50, 60, 3), numpy.uint8))
        os.remove(os.path.join(out, "00000_00001.flo"))
        odd = script("--gaps", "1")
        assert odd.returncode == 1 and "differ in size" in odd.stdout, odd.stdout
    print("raft_flow: files of known motion, read back by regrade evaluate")
    return 0


if __name__ == "__main__":
    sys.exit(main())
