#!/usr/bin/env python3
"""Lets single writes of a run fail, and checks the exit status, the message and the results of a second start.

  write_fault_injection.py REGRADE LIBRARY [--runs 24] [--kinds ENOSPC,EIO,SHORT]     LIBRARY: libfailing_writes.so

A small synthetic capture is run without failures in reproducible mode (the baseline), after the poses and after the
reconstruction. Then a copy is run from either place with its k-th write failing, for `--runs` values of k (0: every k). A failed
write must end the run with exit status 5 and a message that names a file (a short write must change nothing); the same
command must then finish with the baseline's fields and frames byte for byte. Exit status: 0, or 1 if there is a finding.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile

from small_run import SMALL, STYLE, different, make_capture, results

FLAGS = SMALL + ["--threads", "2"]


def call(command, failing=None):
    environment = dict(os.environ, **(failing or {}))
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment,
                          timeout=600)
    return done.returncode, done.stderr.strip()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("regrade")
    parser.add_argument("library", help="libfailing_writes.so")
    parser.add_argument("--runs", type=int, default=24, metavar="N", help="failing writes in each part; 0 is all (24)")
    parser.add_argument("--kinds", default="ENOSPC,EIO,SHORT", help="kinds of failure, in turn (ENOSPC,EIO,SHORT)")
    options = parser.parse_args()
    regrade, library = os.path.abspath(options.regrade), os.path.abspath(options.library)
    failures = tried = ended = 0
    with tempfile.TemporaryDirectory() as scratch:
        capture, work = os.path.join(scratch, "capture"), os.path.join(scratch, "work")
        capture = make_capture(regrade, capture)
        run = [regrade, "run", capture, "--style", STYLE, "--out", work] + FLAGS
        begins = {}
        for name, command in (("poses", "pose"), ("reconstruction", "reconstruct")):
            status, words = call([regrade, command, capture, "--out", work] + FLAGS)
            if status != 0:
                sys.exit(f"{command} of the baseline run: exit status {status}: {words}")
            begins[name] = shutil.copytree(work, os.path.join(scratch, name))
        expected = None
        for name, begin in begins.items():
            def reset():
                shutil.rmtree(work)
                shutil.copytree(begin, work)

            reset()
            count_file = os.path.join(scratch, "count")
            base = {"LD_PRELOAD": library, "FAILING_WRITES_UNDER": work, "FAILING_WRITES_COUNT": count_file}
            if call(run, base)[0] != 0:
                sys.exit("the baseline run failed")
            with open(count_file) as file:
                count = int(file.read())
            expected = expected or results(work)
            if different(results(work), expected):
                sys.exit(f"after the {name}: differs without a failed write: {different(results(work), expected)[:5]}")
            wanted = count if options.runs == 0 else min(options.runs, count)
            kinds = options.kinds.split(",")
            print(f"after the {name}: {count} write operations, {wanted} of them fail in turn", flush=True)
            for i in range(wanted):
                k, kind = 1 + i * count // wanted, kinds[i % len(kinds)]
                reset()
                status, words = call(run, dict(base, FAILING_WRITES_AT=str(k), FAILING_WRITES_KIND=kind))
                problem = None
                last = words.splitlines()[-1] if words else ""
                if status not in ((0,) if kind == "SHORT" else (0, 5)):
                    problem = f"exit status {status}: {last}"
                elif status == 5 and scratch not in words and "/" not in last:
                    problem = f"the message names no file: {last}"
                else:
                    again, words = call(run)
                    if again != 0:
                        problem = f"second start: exit status {again}: {words[-200:]}"
                    elif different(results(work), expected):
                        problem = f"differs: {different(results(work), expected)[:5]}"
                tried += 1
                ended += status == 5
                if problem:
                    failures += 1
                    print(f"  {kind} at {k} of {count}: {problem}", flush=True)
    print(f"{tried} runs, {ended} of them ended because of the failed write, {failures} findings")
    if ended == 0 and set(options.kinds.split(",")) != {"SHORT"}:
        print("no write failed: is the library preloaded?")
        failures += 1
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
