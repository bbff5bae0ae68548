#!/usr/bin/env python3
"""Runs regrade and measures the accuracy of its time estimates.

  measure_run.py REGRADE ARGUMENTS...    e.g. measure_run.py build/cpu/pipeline/regrade run PHOTOS --style S --out OUT

Prints a table: for each stage its seconds and, from 20 % of its work on, the least and largest ratio of the announced
remaining time to the actual one; and the peak memory of the process and its children. Stages below 5 seconds, and
announcements in the last tenth of a stage's time, are not checked. Exit status: that of regrade, or 1 if an announcement
was wrong by more than a factor of 2.
"""

import json
import resource
import subprocess
import sys
import time

LEAST_STAGE_S, LAST_FRACTION, FIRST_FRACTION, FACTOR = 5.0, 0.1, 0.2, 2.0


def main():
    if len(sys.argv) < 3:
        print(__doc__)
        return 0 if "--help" in sys.argv else 2
    child = subprocess.Popen(sys.argv[1:] + ["--json"], stdout=subprocess.PIPE, text=True)
    announced, stages, plans = [], [], []
    for line in child.stdout:
        now = time.monotonic()
        try:
            event = json.loads(line)
        except ValueError:
            continue
        name = event.get("event")
        if name == "stage_begin":
            announced, began = [], now
        elif name == "progress" and event.get("seconds_left") is not None and event.get("total"):
            if event["done"] / event["total"] >= FIRST_FRACTION:
                announced.append((now, event["seconds_left"]))
        elif name == "stage_end":
            ratios = [left / (now - at) for at, left in announced if now - at >= LAST_FRACTION * (now - began)]
            stages.append((event["stage"], now - began, ratios))
        elif name == "info" and "will take" in event.get("text", ""):
            plans.append(event["text"])
    status = child.wait()
    good = True
    print("| stage | seconds | announced / taken, from 20 % on |\n|---|---|---|")
    for stage, seconds, ratios in stages:
        checked = seconds >= LEAST_STAGE_S and ratios
        good = good and (not checked or (min(ratios) >= 1 / FACTOR and max(ratios) <= FACTOR))
        spread = f"{min(ratios):.2f} to {max(ratios):.2f}" if checked else "not checked"
        print(f"| {stage} | {seconds:.1f} | {spread} |")
    peak = max(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, 0) / 1e6
    print(f"\npeak memory {peak:.2f} GB; " + "; ".join(plans))
    return status if status != 0 else (0 if good else 1)


if __name__ == "__main__":
    sys.exit(main())
