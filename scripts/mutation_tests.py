#!/usr/bin/env python3
"""Takes the cares of tests/hard_cases/mutations.json out of the code, one at a time, and sees a test fail each time.

An entry is {case, care, file, find, replace, target, tests}: `find` occurs once in `file`; with `replace` in its place
the test program `target` is built and run with the GoogleTest filter `tests`. Without a target, `tests` is a regular
expression for ctest. An entry {case, cannot_arise} says why there is nothing to take out.
"""

import argparse
import filecmp
import fnmatch
import glob
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile

ENTRIES, TABLE = "tests/hard_cases/mutations.json", "tests/hard_cases/MUTATIONS.md"
# The cases that have an entry: the numbers that tests are named after.
CASES = "H1-H68 H70-H159 F1-F26 F28-F42 F44-F55 F57-F78"
KEYS = {"case", "care", "file", "find", "replace", "target", "tests"}
TEST = re.compile(r"\bTEST(?:_F|_P)?\(\s*(\w+)\s*,\s*(\w+)\s*\)")
FAILURE = r"^(?:\S+:\d+|unknown file): Failure\n"
TEST_SECONDS = 180  # a test that hangs has seen it, too


def all_cases():
    for first, last in (part.split("-") for part in CASES.split()):
        yield from (first[0] + str(number) for number in range(int(first[1:]), int(last[1:]) + 1))


def read(path):
    with open(path, encoding="utf-8") as file:
        return file.read()


def write(path, text):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)


def check(root):
    """(entries, complaints)"""
    try:
        entries = json.loads(read(os.path.join(root, ENTRIES)))
    except (OSError, ValueError) as error:
        return [], [str(error)]
    names, complaints = [], []  # as a filter sees tests, without and with parameters
    for path in glob.glob(os.path.join(root, "tests", "**", "*.cc"), recursive=True):
        for suite, test in TEST.findall(read(path)):
            names += [f"{suite}.{test}", f"Any/{suite}.{test}/0"]
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
            complaints.append(f"{case}: nothing is taken out")
        complaints += [f"{case}: no test is called {pattern}" for pattern in entry["tests"].split(":")
                       if entry["target"] and not fnmatch.filter(names, pattern)]
    have, want = {entry.get("case") for entry in entries}, list(all_cases())
    complaints += [f"{case}: no entry" for case in want if case not in have]
    complaints += [f"{case}: not one of {CASES}" for case in sorted(map(str, have - set(want)))]
    return entries, complaints


def run(command, seconds=None):
    """(output, exit status); the status is None if the time was up."""
    environment = dict(os.environ, OMP_WAIT_POLICY="passive", LC_ALL="C.UTF-8")
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          env=environment, start_new_session=True) as child:
        try:
            return child.communicate(timeout=seconds)[0].decode(errors="replace"), child.returncode
        except subprocess.TimeoutExpired:
            os.killpg(child.pid, signal.SIGKILL)
            return "", None


class Workshop:
    """A copy of the tree and its build directory. What is equal to the copy of last time keeps its date."""

    def __init__(self, root, folder, jobs):
        self.tree, self.build, self.jobs = os.path.join(folder, "tree"), os.path.join(folder, "build"), jobs
        listing = run(["git", "-C", root, "ls-files", "-z", "--cached", "--others", "--exclude-standard"])[0]
        paths = {path for path in listing.split("\0") if os.path.isfile(os.path.join(root, path))}
        for old in glob.glob(os.path.join(self.tree, "**"), recursive=True):
            if os.path.isfile(old) and os.path.relpath(old, self.tree) not in paths:
                os.remove(old)
        for path in paths:
            source, target = os.path.join(root, path), os.path.join(self.tree, path)
            os.makedirs(os.path.dirname(target), exist_ok=True)
            if not os.path.isfile(target) or not filecmp.cmp(source, target, shallow=False):
                shutil.copy(source, target)
        launcher = ["-DCMAKE_CXX_COMPILER_LAUNCHER=ccache"] if shutil.which("ccache") else []
        text, status = run(["cmake", "-G", "Ninja", "-S", self.tree, "-B", self.build, "-DCMAKE_BUILD_TYPE=Release",
                            "-DCMAKE_CXX_FLAGS_RELEASE=-O1 -w", "-DREGRADE_CUDA=OFF", "-DREGRADE_BENCHMARKS=OFF",
                            *launcher])
        if status != 0:
            sys.exit(text)

    def make(self, target):
        """What the compiler complains of, or ''."""
        if not target:
            return ""
        text, status = run(["cmake", "--build", self.build, "--parallel", str(self.jobs), "--target", target])
        return "" if status == 0 else next((s for s in text.splitlines() if "error" in s.lower()), text[-300:])

    def test(self, target, tests):
        """([test that failed], how the first one did)"""
        program = glob.glob(os.path.join(self.build, "tests", "*", target))[0] if target else ""
        text, status = run([program, "--gtest_filter=" + tests, "--gtest_brief=1"] if target else
                           ["ctest", "--test-dir", self.build, "-R", tests, "--output-on-failure"], TEST_SECONDS)
        if status == 0:
            return [], "no test failed"
        failed = list(dict.fromkeys(re.findall(r"^\[  FAILED  \] ([\w/.]+)", text, re.M))) or [tests]
        message = (re.search(FAILURE + r"(.*?)(?=" + FAILURE + r"|^\[  FAILED)", text, re.M | re.S) or
                   re.search(r"^\S+:\d+: (?!remark)(.*)$", text, re.M))
        how = ("did not end" if status is None else message.group(1) if message else
               f"ended by signal {-status}" if status < 0 else f"exit status {status}")
        scratch = re.escape(tempfile.gettempdir())
        for pattern, word in ((re.escape(self.tree + os.sep), ""), (scratch + r"/[^\n:]*", "PATH"),
                              (str(2**64 - 1), "npos"), (r"\d+-byte object <[^>]*>", "an object")):
            how = re.sub(pattern, word, how)
        return failed, " ".join(how.split())

    def take_out(self, entry):
        """(verdict, test, how); the verdict is "failed" if all is as it should be."""
        path = os.path.join(self.tree, entry["file"])
        text = read(path)
        write(path, text.replace(entry["find"], entry["replace"]))
        try:
            complaint = self.make(entry["target"])
            failed, how = ([], complaint) if complaint else self.test(entry["target"], entry["tests"])
        finally:
            write(path, text)
        verdict = "failed" if failed else "DOES NOT COMPILE" if complaint else "SURVIVED"
        return verdict, (failed + [entry["tests"]])[0], how


def run_all(workshop, entries):
    """[(entry, verdict, test, how)]; file after file, so that little is built twice."""
    rows, sound = [(entry, "cannot arise", "", "") for entry in entries if "cannot_arise" in entry], {}
    entries = [entry for entry in entries if "cannot_arise" not in entry]
    for entry in sorted(entries, key=lambda e: (e["target"], e["file"])):
        target = entry["target"]
        if target not in sound:  # nothing taken out yet: all tests that are named pass
            filters = (":" if target else "|").join(e["tests"] for e in entries if e["target"] == target)
            complaint = workshop.make(target)
            sound[target] = complaint or ", ".join(workshop.test(target, filters)[0])
        row = ("UNSOUND", sound[target], "before anything was taken out") if sound[target] else workshop.take_out(entry)
        print(f"{entry['case']:5} {row[0]:9} {row[1]}: {row[2][:100]}", flush=True)
        rows.append((entry, *row))
    return rows


def table_row(entry, *rest):
    """A line of the table, or its beginning without the rest."""
    cells = [entry["case"], entry.get("care", "cannot arise: " + entry.get("cannot_arise", "")), *rest]
    return "| " + " | ".join(cell.replace("|", "\\|").replace("<", "&lt;") for cell in cells) + " |"


def write_table(root, rows):
    """Rows of other cases than these stay as they are."""
    path, order = os.path.join(root, TABLE), {case: i for i, case in enumerate(all_cases())}
    new = {entry["case"] for entry, *_ in rows}
    lines = re.findall(r"^\| [HF]\d+ .*$", read(path), re.M) if os.path.isfile(path) else []
    lines = [line for line in lines if line.split()[1] in order and line.split()[1] not in new]
    for entry, verdict, test, how in rows:
        how = verdict if verdict.isupper() else how if len(how) < 130 else how[:127] + "..."
        lines.append(table_row(entry, test, how))
    lines.sort(key=lambda line: order[line.split()[1]])
    write(path, "# Cares taken out\n\n"
          "Each care of the hard cases, and the test that failed when the code was built without it. Written by\n"
          "`scripts/mutation_tests.py --write` from `mutations.json`; every line has been run.\n\n"
          "| case | care taken out | test that failed | how it failed |\n|---|---|---|---|\n" + "\n".join(lines) + "\n")


def self_test():
    """Plants one mistake at a time; each must be found, and a tidy list be clean."""
    tidy = [{"case": case, "cannot_arise": "no"} for case in all_cases()]
    good = {"case": "H1", "care": "c", "file": "a.cc", "find": "one", "replace": "", "target": "t", "tests": "*S.C*"}
    planted = [({}, ""), ({"find": "twice"}, "occurs 2 times"), ({"find": "none"}, "occurs 0 times"),
               ({"file": "b.cc"}, "occurs 0 times"), ({"replace": "one"}, "nothing is taken out"),
               ({"tests": "X.*"}, "no test is called"), ({"more": ""}, "an entry has"), ({"case": "H0"}, "not one of")]
    lists = [(tidy + [{**good, **change}], expected) for change, expected in planted] + [(tidy[1:], "H1: no entry")]
    failures = 0
    for entries, expected in lists:
        with tempfile.TemporaryDirectory() as root:
            files = {ENTRIES: json.dumps(entries), "a.cc": "one twice twice", "tests/t.cc": "TEST(S, C)"}
            for path, text in files.items():
                write(os.path.join(root, path), text)
            found = check(root)[1]
        if len(found) != bool(expected) or (found and expected not in found[0]):
            failures += 1
            print(f"self-test: expected '{expected}', got {found}")
    print(f"self-test: {len(lists)} lists, {failures} failures")
    return failures


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter,
                                     epilog="Exit status 1: no test failed, or an entry does not apply or compile.")
    parser.add_argument("--root", default=os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    parser.add_argument("--only", metavar="CASE,...", help="these cases alone")
    parser.add_argument("--build", metavar="DIR", help="keep the tree's copy and its build here for the next time")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="compilers side by side (1)")
    parser.add_argument("--write", action="store_true", help=f"write {TABLE}, with --only these cases' lines of it")
    parser.add_argument("--check", action="store_true", help="build nothing: does each entry apply, has each case one?")
    parser.add_argument("--self-test", action="store_true", help="plant mistakes in a list and see --check find them")
    arguments = parser.parse_args()
    if arguments.self_test:
        return 1 if self_test() else 0
    entries, complaints = check(arguments.root)
    if arguments.check and not complaints:
        table = os.path.join(arguments.root, TABLE)
        table = read(table) if os.path.isfile(table) else ""
        complaints = [f"{entry['case']}: not in {TABLE}, see --write" for entry in entries
                      if table_row(entry) not in table]
    for complaint in complaints:
        print(f"{ENTRIES}: {complaint}")
    if arguments.check or complaints:
        print(f"mutation_tests: {len(entries)} entries, {len(complaints)} findings")
        return 1 if complaints else 0
    if arguments.only:
        entries = [entry for entry in entries if entry["case"] in arguments.only.split(",")]
    with tempfile.TemporaryDirectory() as scratch:
        rows = run_all(Workshop(arguments.root, os.path.abspath(arguments.build or scratch), arguments.jobs), entries)
    wrong = sum(verdict not in ("failed", "cannot arise") for _, verdict, _, _ in rows)
    print(f"mutation_tests: {len(rows)} entries, {wrong} not seen to fail")
    if arguments.write:
        write_table(arguments.root, rows)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
