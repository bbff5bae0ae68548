#!/usr/bin/env python3
"""Kills runs at random times, restarts them until they finish, and compares the results with those of an unkilled run.

  crash_recovery.py REGRADE [--kills 1000] [--part-kills 30] [--block-kills 10] [--pose-kills 50] [--seed 0] [--effects mixed-cameras]

After the poses: a small synthetic capture is run once without kills in reproducible mode (the baseline). Then copies of
its poses are run and killed with SIGKILL, SIGTERM or SIGINT at a random time after a stage has begun, stage by stage,
with one thread or two, until they finish. After each kill every file must be complete, and the next start must not
repeat a stage that had ended. The finished folder must have the baseline's fields, network and frames byte for byte, and
its report except for times.

COLMAP's stage is not reproducible: `regrade pose` is killed (SIGKILL is sent to it alone, not to COLMAP) and restarted
until it finishes. Its model must have every photo and lie within 0.5 degrees and 1 % of the camera extent of the truth.
--pose-kills needs colmap. A kill takes about 3 s on two cores.

`regrade render` by parts, three at a time, is killed and begun again in the same way until each has finished; what
--part join makes of them must be the baseline's, too. So are the blocks of `regrade refine`, two at a time, whose field must have
the bytes of one that was refined without a kill.

  --control all   checks that this script finds errors: between two starts a checkpoint is exchanged for that of a run
                  with another seed, a frame is truncated, the record of a finished stage is removed. Each must be found.
                  One bit of a checkpoint is flipped, too: the program itself must detect that, and finish with the same
                  result. "short" is the first of these.

Exit status: 0, or 1 if there is a finding.
"""

import argparse
import collections
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import zipfile

from small_run import SMALL, STAGES, STYLE, STYLED, call, different, make_capture, results
from watched_run import Run

SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
CHECKPOINT_HEAD, HASH_DIGITS = b"regrade checkpoint 1\n", 16


def incomplete_files(folder):
    """Files under their final names that are incomplete."""
    found = []
    for place, _, names in os.walk(folder):
        if os.sep + "work" in place[len(folder):]:
            continue  # COLMAP's own files, not read after it has ended
        for name in names:
            path = os.path.join(place, name)
            try:
                if name.endswith(".npz"):
                    with zipfile.ZipFile(path) as archive:
                        complete = archive.testzip() is None
                elif name.endswith(".png"):
                    with open(path, "rb") as file:
                        complete = file.read()[-8:-4] == b"IEND"
                elif name.endswith(".json"):
                    with open(path, encoding="utf-8") as file:
                        complete = json.load(file) is not None
                else:
                    continue
            except (ValueError, zipfile.BadZipFile):
                complete = False
            if not complete:
                found.append(os.path.relpath(path, folder))
    return found


class Supervisor:
    def __init__(self, regrade, scratch, seed, effects):
        self.regrade, self.scratch, self.random = regrade, scratch, random.Random(seed)
        self.capture, self.work = os.path.join(scratch, "capture"), os.path.join(scratch, "work")
        self.kills, self.findings = collections.Counter(), []
        self.compared = self.starts = 0
        self.posed_capture = make_capture(regrade, self.capture, effects)

    def command(self, threads=2, more=()):
        return [self.regrade, "run", self.posed_capture, "--style", STYLE, "--out", self.work, *SMALL,
                "--threads", str(threads), *more]

    def pose_command(self):
        return [self.regrade, "pose", os.path.join(self.capture, "images"), "--out", self.work, "--photo-size", "256"]

    def report(self, text):
        self.findings.append(text)
        print("FINDING: " + text, flush=True)

    def reset(self, begin=None):
        shutil.rmtree(self.work, ignore_errors=True)
        if begin:
            shutil.copytree(begin, self.work)

    def run_baseline(self):
        """Runs once without kills; stores the results and the duration of each stage."""
        if Run([self.regrade, "pose", self.posed_capture, "--out", self.work, "--photo-size", "96",
                "--tracks", "given"]).finish() != 0:
            sys.exit("the poses of the baseline run failed")
        self.posed = shutil.copytree(self.work, os.path.join(self.scratch, "posed"))
        run, self.duration, last = Run(self.command()), {}, time.monotonic()
        for stage in STAGES[1:]:
            if not run.wait_for(stage):
                break
            now = time.monotonic()
            self.duration[stage], last = now - last, now
        if run.finish() != 0:
            sys.exit("the baseline run failed")
        starts = [self.duration[stage] for stage in STAGES[1:]] + [time.monotonic() - last]
        self.startup = starts[0]
        self.duration = dict(zip(STAGES[1:], starts[1:]))
        self.expected = results(self.work)
        if not any(name.endswith("network.npz") for name in self.expected):
            sys.exit("the baseline run wrote no network")

    def start(self, command, finished, group=True):
        self.starts += 1
        run = Run(command, group)
        run.finished_before = list(finished)
        return run

    def check(self, run, finished, killed_by=None):
        """Checks a run that has ended, and adds its ended stages to `finished`."""
        for stage in run.finished_before:
            if stage in run.began:
                self.report(f"{stage} had ended, and ran again")
        finished += [stage for stage in run.ended if stage not in finished]
        if killed_by is not None:
            for name in incomplete_files(self.work):
                self.report(f"{name} is incomplete after {killed_by.name}")

    def start_and_kill(self, command, finished, stage, delay, group=True):
        """Starts, and kills `delay` seconds after `stage` began (None: after the start). Returns the exit status."""
        number = self.random.choice(SIGNALS)
        run = self.start(command, finished, group)
        if stage is None or run.wait_for(stage):
            time.sleep(delay)
            where = run.stage or ("between two stages" if run.began else "the start")
            status = run.kill(number)
        else:
            status = run.finish()
        self.check(run, finished, number)
        if status == -number:
            self.kills[where, number.name] += 1
        elif status is None:
            self.report(f"still running 60 s after {number.name} in {where}")
        elif status != 0:
            self.report(f"exit status {status} after {number.name} in {where}")
        return status

    def total(self):
        return sum(self.kills.values())

    def compare(self, what):
        changed = different(results(self.work), self.expected)
        self.compared += 1
        if changed:
            self.report(f"{what}: {len(changed)} results differ from the baseline run: {changed[:4]}")

    def complete(self, command, finished):
        run = self.start(command, finished)
        status = run.finish()
        self.check(run, finished)
        if status != 0:
            self.report(f"the last start ended with exit status {status}")

    def run_with_kills(self, most):
        """Runs on a copy of the poses, with a few kills in each stage, until it is finished."""
        self.reset(self.posed)
        finished, limit = ["pose"], self.total() + most
        for stage in (None,) + STAGES[1:]:
            length = self.startup if stage is None else self.duration[stage]
            for _ in range(self.random.choice((0, 1, 2, 3))):
                if self.total() >= limit or stage in finished:
                    break
                # Mostly within the stage, sometimes at its end or in the next one.
                most = length * (0.85 if self.random.random() < 0.8 else 1.3)
                status = self.start_and_kill(self.command(self.random.choice((1, 2))), finished, stage,
                                     self.random.uniform(0, most))
                if status == 0 and stage:  # it ended before the kill: faster than in the baseline run
                    self.duration[stage] *= 0.6
        self.complete(self.command(self.random.choice((1, 2))), finished)
        self.compare("a killed run")

    def parts_with_kills(self, parts=3):
        """Renders a finished folder again by parts, side by side, each killed at random times until it has ended."""
        self.reset(self.posed)
        self.complete(self.command(more=("--until", "stylize")), ["pose"])
        self.kill_parts([self.regrade, "render", self.work], parts, 0.6 * self.duration["render"], "a part")
        status, error = call([self.regrade, "render", self.work, "--part", "join"])
        if status != 0:
            self.report(f"the parts were not joined: {error}")
        self.compare("a film of killed parts")

    def kill_parts(self, command, parts, seconds, what):
        """The parts of a command side by side, each killed at random times until it has ended."""
        left = list(range(parts))
        while left:
            runs = {k: subprocess.Popen([*command, "--threads", "1", "--part", f"{k + 1}/{parts}"], stdin=subprocess.DEVNULL,
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for k in left}
            for k, run in runs.items():
                if self.random.random() < 0.7:
                    time.sleep(self.random.uniform(0, seconds))
                    run.kill()
                status = run.wait()
                if status == -signal.SIGKILL:
                    self.kills[what, "SIGKILL"] += 1
                elif status != 0:
                    sys.exit(f"exit status {status} of part {k + 1} of {command[1]}")
                else:
                    left.remove(k)
            for name in incomplete_files(self.work):
                if ".regrade-tmp" not in name:
                    self.report(f"{name} is incomplete after SIGKILL in {what}")

    def blocks_with_kills(self):
        """Refines a finished field in blocks, two at a time, each killed at random times until all are made."""
        refine = ["--blocks", "3", "--splats", "4", "--splat-steps", "400"]
        self.reset(self.posed)
        self.complete(self.command(more=("--until", "stylize")), ["pose"])
        alone = os.path.join(self.scratch, "refined")
        if not os.path.exists(alone):
            shutil.copytree(self.work, alone)
            begin = time.monotonic()
            status, error = call([self.regrade, "refine", alone, *refine])
            if status != 0:
                sys.exit(f"regrade refine: {error}")
            self.duration["refine"] = time.monotonic() - begin
        for _ in range(5):  # turns of three blocks, with last ones
            self.kill_parts([self.regrade, "refine", self.work, *refine], 2, 0.5 * self.duration["refine"], "a block")
        status, error = call([self.regrade, "refine", self.work, *refine, "--part", "join"])
        if status != 0:
            self.report(f"the blocks were not joined: {error}")
        self.compared += 1
        with open(os.path.join(self.work, "field.npz"), "rb") as one, open(os.path.join(alone, "field.npz"), "rb") as other:
            if one.read() != other.read():
                self.report("the field of killed blocks is another one")

    def pose_with_kills(self, seconds, most, compare_poses):
        """`regrade pose` from photos, with a few kills at any time, until it is finished."""
        self.reset()
        for _ in range(self.random.randint(1, most)):
            if self.start_and_kill(self.pose_command(), [], None, self.random.uniform(0, 1.1 * seconds), group=False) == 0:
                break
        self.complete(self.pose_command(), [])
        self.check_poses(compare_poses)

    def check_poses(self, compare_poses):
        self.compared += 1
        with open(os.path.join(self.work, ".regrade/stages/pose.json"), encoding="utf-8") as file:
            metrics = json.load(file)["metrics"]
        if metrics["registered"] != 8:
            self.report(f"{metrics['registered']} of 8 photos registered")
        if not compare_poses:
            return
        done = subprocess.run([compare_poses, os.path.join(self.work, "poses/sparse"),
                               os.path.join(self.capture, "truth/transforms.json"),
                               os.path.join(self.capture, "images")], stdout=subprocess.PIPE, text=True)
        worst = [float(line.split("largest")[1]) for line in done.stdout.splitlines() if "largest" in line]
        if done.returncode != 0 or len(worst) != 2 or worst[0] > 0.5 or worst[1] > 1:
            self.report("poses after kills: " + " ".join(done.stdout.split()))

    def pose_kills(self, kills, compare_poses):
        self.reset()
        begin = time.monotonic()
        self.complete(self.pose_command(), [])
        seconds = time.monotonic() - begin
        self.check_poses(compare_poses)
        goal = self.total() + kills
        while self.total() < goal:
            self.pose_with_kills(seconds, min(4, goal - self.total()), compare_poses)
        deadline = time.monotonic() + 30
        while time.monotonic() < deadline and self.left_behind():
            time.sleep(0.5)
        for line in self.left_behind():
            self.report("a process was left behind: " + line)

    def left_behind(self):
        found = []
        for number in filter(str.isdigit, os.listdir("/proc")):
            try:
                with open(f"/proc/{number}/cmdline", "rb") as file:
                    words = file.read().replace(b"\0", b" ").decode(errors="replace")
            except OSError:
                continue
            if self.work in words and int(number) != os.getpid():
                found.append(words.strip())
        return found

    def kill_in_fit(self, more=()):
        """Stops a run within the fit; returns the path of its checkpoint."""
        self.reset(self.posed)
        path = os.path.join(self.work, ".regrade/checkpoints/reconstruct")
        for fraction in (0.5, 0.4, 0.3, 0.2, 0.1, 0.0):
            run = Run(self.command(more=more))
            if run.wait_for("reconstruct"):
                time.sleep(fraction * self.duration["reconstruct"])
            run.kill(signal.SIGTERM)
            if os.path.isfile(path):
                return path
            self.reset(self.posed)
        sys.exit("no checkpoint after SIGTERM in the fit")

    def expect_finding(self, what, wanted, change):
        """Changes something between two starts; there must be a finding, or must not be one."""
        before, self.findings = self.findings, []
        print(f"control: {what}; this {'must' if wanted else 'must not'} be found", flush=True)
        change()
        seen, self.findings = bool(self.findings), before
        if seen != wanted:
            self.report(f"control: {what}: {'not found' if wanted else 'not recovered from'}")

    def control(self, short):
        def exchange():
            other = self.kill_in_fit(("--seed", "1"))
            with open(other, "rb") as file:
                foreign = file.read()
            mine = self.kill_in_fit()
            with open(mine, "rb") as file:
                head = file.read(len(CHECKPOINT_HEAD) + HASH_DIGITS)
            with open(mine, "wb") as file:
                file.write(head + foreign[len(head):])
            self.complete(self.command(), ["pose"])
            self.compare("with a foreign checkpoint")

        def flip():
            mine = self.kill_in_fit()
            with open(mine, "r+b") as file:
                file.seek(os.path.getsize(mine) // 2)
                byte = file.read(1)
                file.seek(-1, os.SEEK_CUR)
                file.write(bytes([byte[0] ^ 1]))
            self.complete(self.command(), ["pose"])
            self.compare("with a changed checkpoint")

        def cut():
            self.reset(self.posed)
            self.complete(self.command(), ["pose"])
            frame = os.path.join(self.work, STYLED, "frames/styled/00001.png")
            os.truncate(frame, os.path.getsize(frame) // 2)
            for name in incomplete_files(self.work):
                self.report(f"{name} is incomplete")

        def forget():
            self.reset(self.posed)
            self.complete(self.command(), ["pose"])
            os.remove(os.path.join(self.work, STYLED, ".regrade/stages/render.json"))
            self.complete(self.command(), list(STAGES))

        self.expect_finding("a checkpoint of another seed", True, exchange)
        if short:
            return
        self.expect_finding("one bit of a checkpoint", False, flip)
        self.expect_finding("a frame cut short", True, cut)
        self.expect_finding("a stage's record removed", True, forget)

    def table(self):
        print(f"{'killed in':20}" + "".join(f"{number.name:>9}" for number in SIGNALS))
        for where in ("the start", *STAGES, "between two stages", "a part", "a block"):
            counts = [self.kills[where, number.name] for number in SIGNALS]
            if any(counts):
                print(f"{where:20}" + "".join(f"{count:9}" for count in counts))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("regrade")
    parser.add_argument("--kills", type=int, default=1000, metavar="N", help="kills after the poses (1000)")
    parser.add_argument("--part-kills", type=int, default=30, metavar="N", help="kills within parts of frames and films (30)")
    parser.add_argument("--block-kills", type=int, default=10, metavar="N", help="kills within blocks of a field (10)")
    parser.add_argument("--pose-kills", type=int, default=50, metavar="N", help="kills within COLMAP's stage (50)")
    parser.add_argument("--seed", type=int, default=0, help="seed of stages, times, signals and threads")
    parser.add_argument("--effects", default="", help="effects of the synthetic capture, e.g. mixed-cameras")
    parser.add_argument("--compare-poses", metavar="PROGRAM", help="the test program compare_poses, to check poses against the truth")
    parser.add_argument("--control", choices=("none", "short", "all"), default="none",
                        help="check that planted errors are found")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        supervisor = Supervisor(os.path.abspath(options.regrade), scratch, options.seed, options.effects)
        if options.control != "none" or options.kills or options.part_kills or options.block_kills:
            supervisor.run_baseline()
        if options.control != "none":
            supervisor.control(options.control == "short")
        begin = supervisor.total()
        printed = 0
        while supervisor.total() - begin < options.kills:
            supervisor.run_with_kills(options.kills - supervisor.total() + begin)
            if supervisor.total() // 100 > printed:
                printed = supervisor.total() // 100
                print(f"{supervisor.total()} kills, {supervisor.compared} results compared", flush=True)
        begin = supervisor.total()
        while supervisor.total() - begin < options.part_kills:
            supervisor.parts_with_kills()
        begin = supervisor.total()
        while supervisor.total() - begin < options.block_kills:
            supervisor.blocks_with_kills()
        if options.pose_kills:
            supervisor.pose_kills(options.pose_kills, options.compare_poses)
        supervisor.table()
        print(f"{supervisor.total()} kills, {supervisor.starts} starts, {supervisor.compared} finished runs compared, "
              f"{len(supervisor.findings)} findings")
        return 1 if supervisor.findings else 0


if __name__ == "__main__":
    sys.exit(main())
