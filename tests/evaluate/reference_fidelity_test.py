#!/usr/bin/env python3
"""Compares the distances to a style and to other frames with reference_fidelity.py: same frames, same small networks
with random weights.

  reference_fidelity_test.py REGRADE      exit status 77 (skipped) without numpy
"""

import json
import os
import sys
import tempfile

from reference_evaluator_test import make_frames, numpy, run, write_png
from tiny_networks import write_networks

TOLERANCES = {"lpips_to_2d": 1e-5}
OTHER_TOLERANCE = 1e-4  # networks run in floats; the program's colour distributions are binned
REFERENCE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "reference_fidelity.py")


def main():
    regrade = os.path.abspath(sys.argv[1])
    random = numpy.random.default_rng(3)
    complaints = []
    with tempfile.TemporaryDirectory() as work:
        path = lambda name: os.path.join(work, name)
        make_frames(path("source"), random, 0.01, 3)
        make_frames(path("styled"), random, 0.05, 3)
        y, x = numpy.mgrid[0:301, 0:260]
        style = numpy.stack([0.6 + 0.3 * numpy.sin(0.05 * x), 0.4 + 0.2 * numpy.cos(0.03 * y), 0.2 + 0.0005 * x], axis=2)
        write_png(path("style.png"), (255 * style + 0.5).astype(numpy.uint8))
        write_networks(work, random)
        expected = json.loads(run([sys.executable, REFERENCE, "--frames", path("styled"), "--reference", path("source"),
                                   "--style", path("style.png"), "--weights", path("weights.npz")]))
        measured = {}
        for edges, key in (("gradient", "edge_ssim"), (path("edges.onnx"), "edge_ssim_by_network")):
            run([regrade, "evaluate", "--frames", path("styled"), "--reference", path("source"), "--style", path("style.png"),
                 "--target", path("source"), "--lpips", path("lpips.onnx"), "--config", json.dumps({"edges": edges}), "--gaps", "1",
                 "--out", path("out")])
            with open(path("out/report.json"), encoding="utf-8") as file:
                row = next(r for r in json.load(file)["fidelity"] if r["sequence"] == "styled")
            measured.update({k: v for k, v in row.items() if k in expected and k != "edge_ssim"}, **{key: row["edge_ssim"]})
    for key, want in expected.items():
        have = measured.get(key)
        apart = float("inf") if have is None else abs(have - want)
        tolerance = TOLERANCES.get(key, OTHER_TOLERANCE)
        print(f"{key}: {have}, the reference {want}: {apart:.1e}")
        if not apart <= tolerance or not abs(want) > 10 * tolerance:
            complaints.append(f"{key}: {have}, the reference {want}; tolerance {tolerance}")
    print("\n".join(complaints))
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
