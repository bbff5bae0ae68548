#!/usr/bin/env python3
"""Compares `regrade evaluate` with reference_evaluator.py: same frames, same flow, same metric for each pair.

  reference_evaluator_test.py REGRADE      exit status 77 (skipped) without numpy
"""

import json
import os
import struct
import subprocess
import sys
import tempfile
import zlib

SYSTEM_PYTHON = "/usr/bin/python3"  # the interpreter of Debian's python3-numpy
try:
    import numpy
except ImportError:
    if os.path.exists(SYSTEM_PYTHON) and "REGRADE_NUMPY_RETRIED" not in os.environ:
        os.execve(SYSTEM_PYTHON, [SYSTEM_PYTHON] + sys.argv, {**os.environ, "REGRADE_NUMPY_RETRIED": "1"})
    print("SKIPPED: numpy is missing (Debian: python3-numpy)")
    sys.exit(77)

WIDTH, HEIGHT, FRAMES = 61, 47, 7
GAPS = (1, 3, 5)
# Options of the program, and the reference's options that they stand for: spelled out here, so that a wrong table in the
# program shows.
CASES = tuple((ours.split(), theirs.split()) for ours, theirs in (
    ("--mode lai2018 --gaps 1,3", "--mode lai2018 --gaps 1,3"),
    ("--mode ruder2016 --gaps 1,3", "--mode ruder2016 --gaps 1,3"),
    ("--mode lai2018 --gaps 1,3 --warp earlier", "--mode lai2018 --gaps 1,3 --warp earlier"),
    ("--mode ruder2016 --gaps 1,3 --error-per pixel", "--mode ruder2016 --gaps 1,3 --error-per pixel"),
    ("--protocol liprf", "--mode ruder2016 --gaps 1,5 --warp earlier"),
    ("--protocol liprf --error-per pixel", "--mode ruder2016 --gaps 1,5 --warp earlier --error-per pixel"),
    ("--protocol lai2018", "--mode lai2018 --gaps 1"),
    ("--protocol ruder2016", "--mode ruder2016 --gaps 1")))
TOLERANCE_DB = 1e-4  # frames and flow are identical: only the order of sums differs
REFERENCE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "reference_evaluator.py")


def write_png(path, pixels):
    """8-bit RGB; rows alternate between the filters None, Sub and Up."""
    rows, above = [], numpy.zeros_like(pixels[0])
    for y, row in enumerate(pixels):
        left = numpy.concatenate([numpy.zeros_like(row[:1]), row[:-1]])
        rows.append(bytes([y % 3]) + (row - (0, left, above)[y % 3]).astype(numpy.uint8).tobytes())
        above = row
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        head = struct.pack(">IIBBBBB", pixels.shape[1], pixels.shape[0], 8, 2, 0, 0, 0)
        for kind, body in ((b"IHDR", head), (b"IDAT", zlib.compress(b"".join(rows))), (b"IEND", b"")):
            file.write(struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body)))


def write_flow(path, flow):
    with open(path, "wb") as file:
        file.write(struct.pack("<fii", 202021.25, WIDTH, HEIGHT) + flow.astype("<f4").tobytes())


def make_frames(folder, random, flicker, count=FRAMES):
    os.makedirs(folder)
    y, x = numpy.mgrid[0:HEIGHT, 0:WIDTH]
    for i in range(count):
        u, v = x - 1.7 * i, y + 0.6 * i
        channels = [0.5 + 0.25 * numpy.sin(0.37 * u + 0.2 * v + c) + 0.2 * numpy.sin(0.11 * u - 0.31 * v)
                    for c in range(3)]
        frame = numpy.stack(channels, axis=2) + flicker * random.standard_normal((HEIGHT, WIDTH, 3))
        write_png(os.path.join(folder, f"{i:05d}.png"), numpy.clip(frame * 255 + 0.5, 0, 255).astype(numpy.uint8))


def make_flow(folder, random):
    """Flow with every reason for masking: a discontinuity, disagreement, exits at all borders, unknown patches."""
    os.makedirs(folder)
    y, x = numpy.mgrid[0:HEIGHT, 0:WIDTH]
    for i in range(FRAMES):
        for gap in GAPS:
            if i + gap >= FRAMES:
                continue
            phase = 6.28 * random.random()
            forward = numpy.stack([1.7 * gap + 3 * numpy.sin(0.06 * x + 0.05 * y + phase) + 4 * (x + 0.3 * y > 40),
                                   -0.6 * gap + 3 * numpy.cos(0.05 * x - 0.07 * y + phase)], axis=2)
            backward = -forward + 0.9 * numpy.stack([numpy.sin(0.2 * y + phase), numpy.cos(0.15 * x)], axis=2)
            forward += 0.02 * random.standard_normal(forward.shape)
            forward[5:8, 10:13] = 1e10     # unknown motion in .flo files
            backward[20:22, 30:33] = 1e10
            forward[30, 7] = numpy.nan
            forward[40, 50] = (1e6, -1e6)
            forward[12, 20] = (28.0, 11.0)  # a target on a pixel
            forward[46, 60] = forward[0, 0] = 0  # targets in the frame's corners
            write_flow(os.path.join(folder, f"{i:05d}_{i + gap:05d}.flo"), forward)
            write_flow(os.path.join(folder, f"{i + gap:05d}_{i:05d}.flo"), backward)
    # No pixel of the pair 0, 1 is trusted: its metric is undefined.
    for name in ("00000_00001.flo", "00001_00000.flo"):
        write_flow(os.path.join(folder, name), numpy.full((HEIGHT, WIDTH, 2), 9.0))


def run(command):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    if done.returncode:
        sys.exit(f"{' '.join(command)}\nexit status {done.returncode}\n{done.stdout}")
    return done.stdout


def complaints_of(regrade, work, options, reference_options):
    case = " ".join(options)
    out = os.path.join(work, "out")
    run([regrade, "evaluate", "--frames", os.path.join(work, "styled"), "--reference", os.path.join(work, "source"),
         "--flow", "files:" + os.path.join(work, "flow"), *options, "--out", out])
    with open(os.path.join(out, "report.json"), encoding="utf-8") as file:
        pairs = json.load(file)["consistency_pairs"]
    complaints, compared, worst = [], 0, 0.0
    for sequence in ("source", "styled"):
        expected = json.loads(run([sys.executable, REFERENCE, "--frames", os.path.join(work, sequence), "--flow",
                                   os.path.join(work, "flow"), *reference_options]))["pairs"]
        ours = {(p["from"], p["to"]): p for p in pairs if p["sequence"] == sequence}
        if len(ours) != len(expected):
            complaints.append(f"{case}, {sequence}: {len(ours)} pairs, the reference has {len(expected)}")
        for want in expected:
            have = ours.get((want["from"], want["to"]), {})
            a, b = have.get("tc_psnr_db"), want["tc_psnr_db"]
            apart = 0 if a is None and b is None else abs(a - b) if None not in (a, b) else float("inf")
            coverage_difference = abs(have.get("coverage", -1) - want["coverage"])
            compared, worst = compared + (b is not None), max(worst, apart)
            if apart > TOLERANCE_DB or coverage_difference > 1e-6:
                complaints.append(f"{case}, {sequence}, {want['from']} to {want['to']}: {a} dB of "
                                  f"{have.get('coverage')}, the reference {b} dB of {want['coverage']}")
    print(f"{case}: {compared} pairs with a metric, maximum difference {worst:.2e} dB")
    if compared != 2 * (len(expected) - 1):
        complaints.append(f"{case}: {compared} pairs have a metric; one of each sequence must be undefined")
    return complaints


def main():
    regrade = os.path.abspath(sys.argv[1])
    random = numpy.random.default_rng(1)
    with tempfile.TemporaryDirectory() as work:
        make_frames(os.path.join(work, "source"), random, 0.01)
        make_frames(os.path.join(work, "styled"), random, 0.05)
        make_flow(os.path.join(work, "flow"), random)
        complaints = [line for case in CASES for line in complaints_of(regrade, work, *case)]
    print("\n".join(complaints))
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
