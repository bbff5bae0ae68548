#!/usr/bin/env python3
"""Compares `regrade evaluate --protocol stylegaussian` with scripts/stylegaussian_consistency.py: same frames, same flow,
each pair's RMSE by both readings.

  stylegaussian_test.py REGRADE      exit status 77 (skipped) without numpy
"""

import json
import os
import sys
import tempfile

from reference_evaluator_test import make_frames, numpy, run, write_flow, FRAMES, HEIGHT, WIDTH

TOLERANCE = 1e-4  # frames and flow are the same: floats against doubles
SCRIPT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "stylegaussian_consistency.py")
GAPS = (1, 7)


def make_flow(folder, random):
    """Motion that folds, leaves the frame at all borders, and is unknown in places."""
    os.makedirs(folder)
    y, x = numpy.mgrid[0:HEIGHT, 0:WIDTH]
    for gap in GAPS:
        for i in range(FRAMES + 2 - gap):
            phase = 6.28 * random.random()
            flow = numpy.stack([1.7 * gap + 3 * numpy.sin(0.4 * x + 0.05 * y + phase) + 4 * (x + 0.3 * y > 40),
                                -0.6 * gap + 3 * numpy.cos(0.05 * x - 0.3 * y + phase)], axis=2)
            flow[5:8, 10:13] = 1e10
            flow[30, 7] = numpy.nan
            flow[40, 50] = (1e6, -1e6)
            write_flow(os.path.join(folder, f"{i:05d}_{i + gap:05d}.flo"), flow)


def main():
    regrade = os.path.abspath(sys.argv[1])
    random = numpy.random.default_rng(2)
    complaints, worst = [], 0.0
    with tempfile.TemporaryDirectory() as work:
        path = lambda *names: os.path.join(work, *names)
        make_frames(path("source"), random, 0.01, FRAMES + 2)
        make_frames(path("styled"), random, 0.05, FRAMES + 2)
        make_flow(path("flow"), random)
        make_flow(path("flow", "styled"), random)
        run([regrade, "evaluate", "--protocol", "stylegaussian", "--frames", path("styled"), "--reference", path("source"),
             "--flow", "files:" + path("flow"), "--out", path("out")])
        with open(path("out", "report.json"), encoding="utf-8") as file:
            rows = json.load(file)["warped"]
        flows = {"source": path("flow"), "styled": path("flow", "styled")}
        compared = 0
        for sequence, flow in flows.items():
            expected = json.loads(run([sys.executable, SCRIPT, "--frames", path(sequence), "--flow", flow, "--unstyled",
                                       path("source"), "--unstyled-flow", path("flow")]))["pairs"]
            for gap in GAPS:
                row = next(r for r in rows if r["sequence"] == sequence and r["gap"] == gap)
                for ours, theirs in (("rmse_pairs_published", "rmse"), ("rmse_pairs", "rmse_corrected")):
                    want = [pair[theirs] for pair in expected if pair["gap"] == gap]
                    compared += len(want)
                    apart = max((abs(a - b) for a, b in zip(row[ours], want)), default=float("inf"))
                    worst = max(worst, apart)
                    if len(want) != len(row[ours]) or not apart <= TOLERANCE:
                        complaints.append(f"{sequence}, gap {gap}, {theirs}: {row[ours]}, the script {want}")
                    mean = row["rmse_published" if theirs == "rmse" else "rmse"]
                    if not abs(mean - sum(want) / len(want)) <= TOLERANCE:
                        complaints.append(f"{sequence}, gap {gap}, mean of {theirs}: {mean}")
    print(f"{compared} values, maximum difference {worst:.1e}")
    print("\n".join(complaints))
    return 1 if complaints or compared != 2 * 2 * (FRAMES + 1 + FRAMES - 5) else 0


if __name__ == "__main__":
    sys.exit(main())
