#!/usr/bin/env python3
"""Kills a run with SIGKILL in each of its stages, starts it again, and requires that only the open stage is redone.

  kill_each_stage.py REGRADE [--scene table]    about 4 minutes on two cores; needs colmap

A synthetic capture is made in a temporary folder, and run once undisturbed. Then, for each stage: a fresh copy is run
until that stage has begun and worked for a moment, is killed together with its children, and is started again. It must
finish, announce every earlier stage as done before, and redo the killed one. Exit status 1 otherwise.
"""

import argparse
import glob
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time

STAGES = ("pose", "reconstruct", "style_2d", "stylize", "render", "evaluate", "report")
SMALL = ["--photo-size", "160", "--fit-resolutions", "32,64", "--fit-steps", "150,300", "--style-steps", "60",
         "--path-frames", "8", "--preset", "draft"]


def start(command):
    return subprocess.Popen(command + ["--json"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
                            start_new_session=True)


def events_of(child):
    for line in child.stdout:
        try:
            yield json.loads(line)
        except ValueError:
            pass


def kill_in(command, stage, delay):
    """True if the run was killed while `stage` was open."""
    child = start(command)
    for event in events_of(child):
        if event.get("event") == "stage_begin" and event.get("stage") == stage:
            time.sleep(delay)
            os.killpg(child.pid, signal.SIGKILL)
            break
    rest = [e.get("stage") for e in events_of(child) if e.get("event") == "stage_end"]
    child.wait()
    return stage not in rest


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("regrade")
    parser.add_argument("--scene", default="table")
    options = parser.parse_args()
    regrade = os.path.abspath(options.regrade)
    failures = 0
    with tempfile.TemporaryDirectory() as scratch:
        capture = os.path.join(scratch, "capture")
        subprocess.run([regrade, "synth", capture, "--scene", options.scene], check=True, stderr=subprocess.DEVNULL)
        style = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "assets", "style_sunset.png")
        finished = ""

        def command(out):
            return [regrade, "run", os.path.join(capture, "images"), "--style", style, "--out", out] + SMALL

        for number, stage in enumerate(STAGES):
            out = os.path.join(scratch, stage)
            if stage not in ("pose", "reconstruct"):  # the stages before it are finished in `out`
                shutil.copytree(finished, out)
                for later in STAGES[number:]:
                    for record in glob.glob(os.path.join(out, ".regrade", "stages", later + ".*")):
                        os.remove(record)
            open_stage = kill_in(command(out), stage, 0.0 if stage in ("style_2d", "report") else 0.4)
            child = start(command(out))
            done_before, redone, bad = [], [], ""
            for event in events_of(child):
                if event.get("event") == "stage_end":
                    redone.append(event["stage"])
                if event.get("event") == "info" and event["text"].endswith(": done before"):
                    done_before.append(event["text"].split(":")[0])
            if child.wait() != 0:
                bad = f"exit status {child.returncode}"
            elif tuple(done_before) != STAGES[:number] and open_stage:
                bad = f"done before: {', '.join(done_before)}"
            elif open_stage and stage not in redone:
                bad = "the killed stage was not redone"
            note = "" if open_stage else " (it was over before the signal came)"
            print(f"{stage:12} {'FAILED: ' + bad if bad else 'goes on, nothing earlier redone'}{note}", flush=True)
            failures += bool(bad)
            if stage == "reconstruct":
                finished = out
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
