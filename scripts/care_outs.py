#!/usr/bin/env python3
"""Takes the cares of tests/hard_cases/care_outs.json out of the code, one at a time, and sees a test fail each time.

An entry is {case, care, file, find, replace, target, tests}: `find` occurs once in `file`; with `replace` in its place
`target`, a test program, is built and run with the GoogleTest filter `tests`. Without a target `tests` is a regular
expression for ctest. An entry {case, cannot_arise} says why there is nothing to take out.

  care_outs.py [--only H51,F2] [--build DIR] [--jobs N]   does it in a copy of the tree; exit status 1 if a test did
                                                          not fail, or an entry does not apply or does not compile
  care_outs.py --write       the same, and writes tests/hard_cases/CARE_OUTS.md
  care_outs.py --check       only whether every entry still applies and every case has one
  care_outs.py --self-test   plants each kind of mistake in a scratch tree and sees it found
"""

import argparse
import fnmatch
import glob
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile

ENTRIES, TABLE = "tests/hard_cases/care_outs.json", "tests/hard_cases/CARE_OUTS.md"
# The cases that have an entry: ranges of the numbers that tests are named after.
CASES = ("H1-H22 H31-H48 H51-H67 H71-H86 H99-H106 H109-H110 H125-H137 H141-H152 "
         "F1-F17 F28 F33-F38 F46-F51 F54 F58-F63")
KEYS = {"case", "care", "file", "find", "replace", "target", "tests"}
TEST = re.compile(r"\bTEST(?:_F|_P)?\(\s*(\w+)\s*,\s*(\w+)\s*\)")
TEST_SECONDS = 180  # a mutant that hangs has been seen, too


def all_cases():
    for part in CASES.split():
        first, _, last = part.partition("-")
        for number in range(int(first[1:]), int((last or first)[1:]) + 1):
            yield part[0] + str(number)


def read(path):
    with open(path, encoding="utf-8") as file:
        return file.read()


def test_names(root):
    """As a filter sees them: Suite.Case, and for tests with parameters Any/Suite.Case/0."""
    names = []
    for path in glob.glob(os.path.join(root, "tests", "**", "*.cc"), recursive=True):
        for suite, case in TEST.findall(read(path)):
            names += [f"{suite}.{case}", f"Any/{suite}.{case}/0"]
    return names


def check(root):
    """(entries, complaints)"""
    try:
        entries = json.loads(read(os.path.join(root, ENTRIES)))
    except (OSError, ValueError) as error:
        return [], [f"{ENTRIES}: {error}"]
    complaints, names = [], test_names(root)
    for entry in entries:
        case = entry.get("case")
        if set(entry) == {"case", "cannot_arise"}:
            continue
        if set(entry) != KEYS or not all(isinstance(value, str) for value in entry.values()):
            complaints.append(f"{case}: an entry has {', '.join(sorted(KEYS))}; or case, cannot_arise")
            continue
        path = os.path.join(root, entry["file"])
        count = read(path).count(entry["find"]) if entry["find"] and os.path.isfile(path) else 0
        if count != 1:
            complaints.append(f"{case}: {entry['find'][:60]!r} occurs {count} times in {entry['file']}, not once")
        if entry["find"] == entry["replace"]:
            complaints.append(f"{case}: takes nothing out")
        for pattern in entry["tests"].split(":") if entry["target"] else ():
            if not fnmatch.filter(names, pattern):
                complaints.append(f"{case}: no test is called {pattern}")
    have, want = {entry.get("case") for entry in entries}, list(all_cases())
    complaints += [f"{case}: no entry" for case in want if case not in have]
    complaints += [f"{case}: not one of {CASES}" for case in sorted(map(str, have - set(want)))]
    return entries, complaints


def mirror(root, copy):
    """Makes `copy` the tracked and the new files of `root`; what is equal keeps its time."""
    listing = subprocess.run(["git", "-C", root, "ls-files", "-z", "-co", "--exclude-standard"], check=True,
                             stdout=subprocess.PIPE).stdout
    paths = {path for path in listing.decode().split("\0") if os.path.isfile(os.path.join(root, path))}
    for folder, _, names in os.walk(copy):
        for name in names:
            if os.path.relpath(os.path.join(folder, name), copy) not in paths:
                os.remove(os.path.join(folder, name))
    for path in paths:
        source, target = os.path.join(root, path), os.path.join(copy, path)
        os.makedirs(os.path.dirname(target), exist_ok=True)
        with open(source, "rb") as file:
            content = file.read()
        if not os.path.isfile(target) or open(target, "rb").read() != content:
            shutil.copyfile(source, target)
            shutil.copymode(source, target)


class Workshop:
    """A copy of the tree and its build directory."""

    def __init__(self, root, folder, jobs):
        self.tree, self.build, self.jobs = os.path.join(folder, "tree"), os.path.join(folder, "build"), jobs
        mirror(root, self.tree)
        launcher = ["-DCMAKE_CXX_COMPILER_LAUNCHER=ccache"] if shutil.which("ccache") else []
        code, text = self.run(["cmake", "-G", "Ninja", "-S", self.tree, "-B", self.build, "-DREGRADE_CUDA=OFF",
                               "-DREGRADE_BENCHMARKS=OFF", "-DCMAKE_BUILD_TYPE=Release",
                               "-DCMAKE_CXX_FLAGS_RELEASE=-O1 -w", *launcher], None)
        if code != 0:
            sys.exit(text)

    def run(self, command, seconds):
        """(exit status, output); the status is None after `seconds`."""
        environment = dict(os.environ, OMP_WAIT_POLICY="passive", LC_ALL="C.UTF-8")
        try:
            done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                  stderr=subprocess.STDOUT, timeout=seconds, env=environment)
            return done.returncode, done.stdout.decode(errors="replace")
        except subprocess.TimeoutExpired:
            return None, ""

    def make(self, target):
        return self.run(["cmake", "--build", self.build, "--parallel", str(self.jobs), "--target", target], 3600)

    def test(self, target, tests):
        """(tests run, [test that failed], how the first failed)"""
        if not target:
            code, text = self.run(["ctest", "--test-dir", self.build, "-R", tests, "--output-on-failure"], TEST_SECONDS)
            run = "No tests were found" not in text
            lines = [line for line in text.splitlines() if re.match(r"\S+:\d+: ", line) and "remark:" not in line]
            return run, [tests] if code != 0 else [], lines[0].split(": ", 1)[1] if lines else "exit status not 0"
        programs = glob.glob(os.path.join(self.build, "tests", "*", target))
        code, text = self.run([*programs, "--gtest_filter=" + tests, "--gtest_brief=1"], TEST_SECONDS)
        if code is None:
            return 1, [tests], f"did not end within {TEST_SECONDS} s"
        ran = re.search(r"\[=+\] (\d+) tests?.* ran", text)
        failed = list(dict.fromkeys(re.findall(r"^\[  FAILED  \] ([\w/.]+)", text, re.M)))
        if code != 0 and not ran:
            return 1, [tests], "killed by signal %d" % -code if code < 0 else (text.strip().splitlines() or ["?"])[-1]
        start = r"^(?:\S+:\d+|unknown file): Failure\n"
        message = re.search(start + r"(.*?)(?=" + start + r"|^\[  FAILED)", text, re.M | re.S)
        how = " ".join(re.sub(r"\d+-byte object <[^>]*>", "an object", message.group(1)).split()) if message else "?"
        return int(ran.group(1)) if ran else 0, failed, how


def take_out(workshop, entry):
    """(verdict, test, how): the verdict is 'failed' if all is as it should be."""
    path = os.path.join(workshop.tree, entry["file"])
    text = read(path)
    with open(path, "w", encoding="utf-8") as file:
        file.write(text.replace(entry["find"], entry["replace"]))
    try:
        code, output = workshop.make(entry["target"]) if entry["target"] else (0, "")
        if code != 0:
            errors = [line for line in output.splitlines() if "error" in line.lower()]
            return "DOES NOT COMPILE", entry["tests"], (errors or ["?"])[0]
        _, failed, how = workshop.test(entry["target"], entry["tests"])
        return ("failed", failed[0], how) if failed else ("SURVIVED", entry["tests"], "no test failed")
    finally:
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)


def run_all(workshop, entries):
    """[(entry, verdict, test, how)], files by turns so that little is built twice."""
    rows, sound = [], {}
    for entry in sorted(entries, key=lambda e: (e.get("target", ""), e.get("file", ""))):
        if "cannot_arise" in entry:
            rows.append((entry, "cannot arise", "", entry["cannot_arise"]))
            continue
        target = entry["target"]
        if target not in sound:
            code, output = workshop.make(target) if target else (0, "")
            filters = [e["tests"] for e in entries if e.get("target") == target and "tests" in e]
            failed = workshop.test(target, (":" if target else "|").join(filters))[1] if code == 0 else [output[-300:]]
            sound[target] = f"before anything was taken out, failed: {', '.join(failed)}" if failed else ""
        row = ("UNSOUND", entry["tests"], sound[target]) if sound[target] else take_out(workshop, entry)
        rows.append((entry, *row))
        print(f"{entry['case']:5} {row[0]:9} {row[1]}: {row[2][:110]}", flush=True)
    return rows


def markdown(rows):
    number = {case: i for i, case in enumerate(all_cases())}
    text = ("# Cares taken out\n\nEach care of the hard cases, what the code does without it, and the test that saw "
            "it. Written by\n`scripts/care_outs.py --write` from `care_outs.json`; every line has been run.\n\n"
            "| case | care taken out | test that failed | how it failed |\n|---|---|---|---|\n")
    cell = lambda s: " ".join(s.replace("|", "\\|").replace("<", "&lt;").split())
    for entry, verdict, test, how in sorted(rows, key=lambda row: number.get(row[0]["case"], 0)):
        care = "cannot arise: " + how if verdict == "cannot arise" else entry["care"]
        how = {"cannot arise": "", "failed": how if len(how) < 130 else how[:127] + "..."}.get(verdict, verdict)
        text += f"| {entry['case']} | {cell(care)} | {cell(test)} | {cell(how)} |\n"
    return text


def self_test():
    """Plants one mistake at a time; each must be found, and a tidy list be clean."""
    tidy = [{"case": case, "cannot_arise": "no"} for case in all_cases()]
    good = {"case": "H1", "care": "c", "file": "a.cc", "find": "one", "replace": "", "target": "t", "tests": "*S.C*"}
    planted = [(tidy + [good], ""), (tidy[1:], "H1: no entry"), (tidy + [{**good, "find": "twice"}], "occurs 2 times"),
               (tidy + [{**good, "find": "none"}], "occurs 0 times"), (tidy + [{**good, "replace": "one"}], "nothing"),
               (tidy + [{**good, "file": "b.cc"}], "occurs 0 times"), (tidy + [{**good, "tests": "X.*"}], "no test"),
               (tidy + [{"case": "H1", "find": "one"}], "an entry has"), (tidy + [{**good, "case": "H999"}], "not one of")]
    failures = 0
    for entries, expected in planted:
        with tempfile.TemporaryDirectory() as root:
            os.makedirs(os.path.join(root, "tests", "hard_cases"))
            for path, text in ((ENTRIES, json.dumps(entries)), ("a.cc", "one twice twice"), ("tests/t.cc", "TEST(S, C)")):
                with open(os.path.join(root, path), "w", encoding="utf-8") as file:
                    file.write(text)
            found = check(root)[1]
        if len(found) != bool(expected) or (found and expected not in found[0]):
            failures += 1
            print(f"self-test: expected '{expected}', got {found}")
    print(f"self-test: {len(planted)} lists, {failures} failures")
    return failures


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", default=os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    parser.add_argument("--only", metavar="CASE,...", help="these cases alone")
    parser.add_argument("--build", metavar="DIR", help="keep the copy and its build here, and use them again")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="compilers side by side (1)")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--self-test", action="store_true")
    arguments = parser.parse_args()
    if arguments.self_test:
        return 1 if self_test() else 0
    entries, complaints = check(arguments.root)
    for complaint in complaints:
        print(f"{ENTRIES}: {complaint}")
    if arguments.check or complaints:
        print(f"care_outs: {len(entries)} entries, {len(complaints)} findings")
        return 1 if complaints else 0
    if arguments.only:
        entries = [entry for entry in entries if entry["case"] in arguments.only.split(",")]
    with tempfile.TemporaryDirectory() as scratch:
        workshop = Workshop(arguments.root, os.path.abspath(arguments.build or scratch), arguments.jobs)
        rows = run_all(workshop, entries)
    wrong = sum(verdict not in ("failed", "cannot arise") for _, verdict, _, _ in rows)
    print(f"care_outs: {len(rows)} entries, {wrong} not seen to fail")
    if arguments.write:
        with open(os.path.join(arguments.root, TABLE), "w", encoding="utf-8") as file:
            file.write(markdown(rows))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
