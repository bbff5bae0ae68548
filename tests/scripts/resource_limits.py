#!/usr/bin/env python3
"""Runs regrade with too little disk, memory or open files, and two runs at once; checks exit status and recovery.

  resource_limits.py REGRADE [--pairs 100] [--sizes 6]        needs colmap; root for the full disks, which are skipped otherwise

  full disks     each stage, COLMAP's included, on small file systems of several sizes: exit status 5 and a message that
                 names the disk, or 0 if the size was enough; with enough space the same command finishes with the
                 results of an unlimited run
  read-only      exit status 5 before any work
  ulimit -f      limited file size: 5, and the same command finishes without the limit
  ulimit -n      few open files: 0 or 5
  ulimit -v      little address space, but enough for the program to start: 0 or 5, and the same command finishes
                 without the limit
  two at once    pairs started together on one folder: one does the work, the other exits with 7

Exit status: 0, or 1 if there is a finding.
"""

import argparse
import os
import resource
import shutil
import subprocess
import sys
import tempfile

from small_run import SMALL, STAGES, STYLE, STYLED, call, different, make_capture, results


def size_of(folder):
    """Bytes as a tmpfs counts them: in whole pages, folders included."""
    total = 0
    for place, folders, names in os.walk(folder):
        total += 4096 * len(folders)
        for name in names:
            total += (os.lstat(os.path.join(place, name)).st_size + 4095) // 4096 * 4096
    return total


class Trials:
    def __init__(self, regrade, scratch):
        self.regrade, self.scratch = regrade, scratch
        self.capture, self.work = os.path.join(scratch, "capture"), os.path.join(scratch, "work")
        self.findings = self.trials = self.ended = 0
        self.begins, self.expected = {}, {}
        self.posed_capture = make_capture(regrade, self.capture)

    def command(self):
        return [self.regrade, "run", self.posed_capture, "--style", STYLE, "--out", self.work, *SMALL]

    def pose(self):
        """The command that estimates poses from photos with COLMAP."""
        return [self.regrade, "pose", os.path.join(self.capture, "images"), "--out", self.work, "--photo-size", "256"]

    def expect(self, what, outcome, allowed, words=()):
        status, text = outcome
        self.trials += 1
        self.ended += status != 0
        if status not in allowed:
            self.findings += 1
            print(f"FINDING: {what}: exit status {status}, not {allowed}: {text[-300:]}", flush=True)
        elif status == 5 and words and not any(word in text for word in words):
            self.findings += 1
            print(f"FINDING: {what}: the message has none of {words}: {text[-300:]}", flush=True)

    def finishes(self, what, command, expected):
        """Without the limit, the same command finishes with the expected results."""
        self.expect(what + ", then without the limit", call(command), (0,))
        changed = different(results(self.work), expected) if expected else []
        if changed:
            self.findings += 1
            print(f"FINDING: {what}: afterwards {len(changed)} results differ: {changed[:4]}", flush=True)

    def run_baseline(self):
        """Runs once without limits, and keeps a copy of the folder before each stage."""
        for name, command in (("reconstruct", "pose"), ("style_2d", "reconstruct")):
            status, words = call([self.regrade, command, self.posed_capture, "--out", self.work, *SMALL])
            if status != 0:
                sys.exit(f"{command} failed without limits: {words}")
            self.begins[name] = shutil.copytree(self.work, os.path.join(self.scratch, name))
        if call(self.command())[0] != 0:
            sys.exit("the baseline run failed")
        self.expected = results(self.work)
        # Before a later stage: the finished folder without the records and outputs of this stage and later ones.
        makes = {"stylize": ("network.npz",), "render": ("frames", "styled.mp4", "source_vs_styled.mp4"),
                 "evaluate": (), "report": ("report.html", "report.json")}
        for number, name in enumerate(STAGES):
            if name not in makes:
                continue
            self.begins[name] = shutil.copytree(self.work, os.path.join(self.scratch, name))
            for later in STAGES[number:]:
                for gone in (f".regrade/stages/{later}.json", *makes.get(later, ())):
                    path = os.path.join(self.begins[name], STYLED, gone)
                    shutil.rmtree(path) if os.path.isdir(path) else os.path.exists(path) and os.remove(path)
        self.finished = size_of(self.work)

    def reset(self, begin):
        shutil.rmtree(self.work, ignore_errors=True)
        if begin:
            shutil.copytree(self.begins[begin], self.work)
        else:
            os.makedirs(self.work)

    # --- disks

    def mount(self, size, options=""):
        shutil.rmtree(self.work, ignore_errors=True)
        os.makedirs(self.work)
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}{options}", "tmpfs", self.work], check=True)

    def remount(self, options):
        subprocess.run(["mount", "-o", "remount," + options, self.work], check=True)

    def on_disk_of(self, name, begin, size, command, expected):
        self.mount(1 << 30)
        try:
            if begin:
                shutil.copytree(self.begins[begin], self.work, dirs_exist_ok=True)
            self.remount(f"size={max(size, size_of(self.work) + 4096)}")
            self.expect(f"{name} on a disk of {size >> 10} KiB", call(command), (0, 5),
                        ("No space left", "disk is full", "free some space", "free space"))
            self.remount("size=1073741824")
            self.finishes(f"{name} on a disk of {size >> 10} KiB", command, expected)
        finally:
            subprocess.run(["umount", self.work], check=True)

    def full_disks(self, sizes, short):
        for name in ("stylize", "render") if short else STAGES[1:]:
            begin = size_of(self.begins[name])
            room = max(self.finished - begin, 64 << 10)
            for i in range(sizes):
                self.on_disk_of(name, name, begin + room * (2 * i + 1) // (2 * sizes), self.command(), self.expected)
        if short:
            return
        self.reset("")
        status, words = call(self.pose())
        if status != 0:
            sys.exit("poses from photos failed without limits: " + words)
        whole = size_of(self.work)
        for i in range(sizes):
            self.on_disk_of("pose", "", whole * (2 * i + 1) // (2 * sizes), self.pose(), None)

    def read_only(self):
        self.mount(1 << 26)
        try:
            self.remount("ro")
            self.expect("a read-only folder", call(self.command()), (5,), (self.work,))
        finally:
            subprocess.run(["umount", self.work], check=True)

    # --- limits

    def limited(self, what, begin, limit, value, allowed):
        self.reset(begin)
        self.expect(f"{what} {value}", call(self.command(), preexec_fn=lambda: resource.setrlimit(limit, (value, value))),
                    allowed)
        self.finishes(f"{what} {value}", self.command(), self.expected)

    def limits(self, short):
        begin = "stylize" if short else "reconstruct"
        for value in (1 << 16,) if short else (1 << 10, 1 << 12, 1 << 14, 1 << 16, 1 << 18, 1 << 20):
            self.limited("files of at most", begin, resource.RLIMIT_FSIZE, value, (0, 5))
        for value in (16,) if short else (4, 6, 8, 10, 12, 16, 24, 32):
            self.limited("open files, at most", begin, resource.RLIMIT_NOFILE, value, (0, 5))
        least = self.least_memory()
        for more in (60,) if short else (5, 10, 20, 40, 60, 80, 120, 160, 240, 320, 480):
            self.limited("bytes of address space, at most", begin, resource.RLIMIT_AS, least + (more << 20), (0, 5))

    def least_memory(self):
        """The least address space in which the program starts."""
        for value in range(100 << 20, 4 << 30, 10 << 20):
            if call([self.regrade, "--version"],
                    preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (value, value)))[0] == 0:
                return value
        sys.exit("the program does not start in 4 GB of address space")

    # --- two at once

    def pairs(self, count):
        command = [self.regrade, "pose", self.posed_capture, "--out", self.work, "--photo-size", "96",
                   "--tracks", "given"]
        both = number = 0
        # On a fast machine a run may end before the other has begun: some more until two have met.
        while number < count or (both == number and number < 20 * count):
            shutil.rmtree(self.work, ignore_errors=True)
            runs = [subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                     stderr=subprocess.PIPE, text=True) for _ in range(2)]
            messages = [run.communicate(timeout=120)[1] for run in runs]
            status = sorted(run.returncode for run in runs)
            self.trials += 1
            # If the second starts late, it finds the work finished.
            late = status == [0, 0] and any("done before" in words for words in messages)
            both += late
            if status != [0, 7] and not late:
                self.findings += 1
                print(f"FINDING: two at once, pair {number}: exit status {status}: {messages}", flush=True)
            number += 1
        print(f"two at once: {number} pairs, in {both} of them the second started after the first had finished", flush=True)
        if count >= 5 and both == number:
            self.findings += 1
            print("FINDING: no two runs overlapped")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("regrade")
    parser.add_argument("--pairs", type=int, default=100, metavar="N", help="pairs of runs on one folder (100)")
    parser.add_argument("--sizes", type=int, default=6, metavar="N", help="disk sizes for each stage (6)")
    parser.add_argument("--short", action="store_true", help="one limit of each kind, and disks for two stages")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        trials = Trials(os.path.abspath(options.regrade), scratch)
        trials.run_baseline()
        trials.pairs(options.pairs)
        trials.limits(options.short)
        if os.geteuid() == 0:
            try:
                trials.mount(1 << 20)
                subprocess.run(["umount", trials.work], check=True)
                mounts = True
            except (OSError, subprocess.CalledProcessError):
                mounts = False
        else:
            mounts = False
        if mounts:
            trials.read_only()
            trials.full_disks(options.sizes, options.short)
        else:
            print("SKIPPED: full disks and read-only folders, which need root with permission to mount", flush=True)
        print(f"{trials.trials} trials, {trials.ended} ended by their limit, {trials.findings} findings")
        return 1 if trials.findings else 0


if __name__ == "__main__":
    sys.exit(main())
