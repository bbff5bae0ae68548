#!/usr/bin/env python3
"""Measures the overhead of durable writes, checksums, validation of inputs, staged photos and reproducible sums.

  safety_overhead.py REGRADE --library LIBRARY --tool TOOL [--views 24] [--size 640x480] [--preset draft]
                             [-- OPTIONS OF run]

LIBRARY is libtimed_writes.so and TOOL validation_tool, both built with the tests. A synthetic capture is run; then the
overheads are printed as percentages of the run's wall or CPU seconds:

  durable writes   wall seconds in fsync and rename, timed by the preloaded library
  checksums        CPU seconds of the same command again, which reads every file of the run once, less those of
                   `regrade --version`; a run computes each checksum once, when its stage ends
  checks           validation of a field that is read (links, values, sizes), times the stages that read one, and
                   reading COLMAP's model
  staging          CPU seconds of `regrade pose` from photos with poses: each is decoded, checked and written again
  fixed sums       CPU seconds of the run with --reproducible, less those without

Wall seconds are meaningful only on an otherwise idle machine. Exit status: 0, or 1 if a command failed.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time

from small_run import STYLE

FIELD_READS = 5  # field.npz by reconstruct, stylize, render (twice) and evaluate


def measured(command, environment=None):
    """(wall seconds, CPU seconds)"""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                          env=dict(os.environ, **(environment or {})))
    wall, after = time.monotonic() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}: exit status {done.returncode}: {done.stderr[-500:]}")
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def print_row(name, what, seconds, of, whole):
    print(f"{name:16} {seconds:10.3f} s {100 * seconds / whole:8.2f} % of {of} {whole:.1f} s   {what}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("regrade")
    parser.add_argument("--library", required=True)
    parser.add_argument("--tool", required=True)
    parser.add_argument("--views", default="24")
    parser.add_argument("--size", default="640x480")
    parser.add_argument("--preset", default="draft")
    words = sys.argv[1:]
    end = words.index("--") if "--" in words else len(words)
    options, of_runs = parser.parse_args(words[:end]), words[end + 1:]
    regrade = os.path.abspath(options.regrade)
    with tempfile.TemporaryDirectory() as scratch:
        capture, report = os.path.join(scratch, "capture"), os.path.join(scratch, "times")
        measured([regrade, "synth", capture, "--scene", "table", "--views", options.views, "--size", options.size])

        def run(out, *more):
            return [regrade, "run", os.path.join(capture, "truth"), "--style", STYLE, "--out", os.path.join(scratch, out),
                    "--preset", options.preset, "--device", "cpu", "--tracks", "given", *of_runs, *more]

        timed = {"LD_PRELOAD": os.path.abspath(options.library), "TIMED_WRITES_REPORT": report}
        wall, cpu = measured(run("plain"), timed)
        calls, seconds = {}, {}
        with open(report, encoding="utf-8") as file:
            for line in file:
                name, count, spent = line.split()
                calls[name] = calls.get(name, 0) + int(count)
                seconds[name] = seconds.get(name, 0) + float(spent)
        print_row("durable writes", f"{calls['fsync']} fsync, {calls['rename']} rename", sum(seconds.values()), "wall", wall)
        again, start = measured(run("plain"))[1], measured([regrade, "--version"])[1]
        print_row("checksums", "every file of the run once", max(0, again - start), "CPU", cpu)
        timings = dict(line.split() for line in subprocess.run(
            [options.tool, os.path.join(scratch, "plain/field.npz"), os.path.join(scratch, "plain/poses/sparse")],
            check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines())
        print_row("checks", f"{timings['checks']} s a field; COLMAP's model read in {timings['model']} s",
                  FIELD_READS * float(timings["checks"]) + float(timings["model"]), "CPU", cpu)
        pose = measured([regrade, "pose", os.path.join(capture, "truth"), "--tracks", "given",
                         "--out", os.path.join(scratch, "posed")])[1]
        print_row("staging", f"{options.views} photos", max(0, pose - start), "CPU", cpu)
        fixed = measured(run("fixed", "--reproducible"))[1]
        print_row("fixed sums", "--reproducible, against without", fixed - cpu, "CPU", cpu)


if __name__ == "__main__":
    main()
