#!/usr/bin/env python3
"""Writes tests/hard_cases/RESULTS.md: each hard case with its tests, what they measured, and the safeguards removed.

  hard_cases.py             writes the page
  hard_cases.py --check     writes nothing; fails if the page is out of date, if a named test does not exist, or if a case
                            has neither a test nor a reason
  hard_cases.py --measured build/cpu
                            runs the tests that measure numbers, stores the results (measured.json), writes the page
  hard_cases.py --measured REPORT.xml...
                            the same from GoogleTest's reports or folders of them: for tests that began to measure, and for
                            device_parity_test and device_style_test --gtest_output=xml:FILE on a machine with a GPU

Exit status: 0, or 1 if there is a finding.

A test belongs to the case whose number is in its name ("Mkl.H7_H20_StyleOfOneColour"). tests/hard_cases/cases.json has the
cases' titles, further tests ("tests": names with *, or names of ctest), a reason ("why") where there is no test, and a
reason ("unseen") where no safeguard can be removed. The safeguards and the tests that failed without them come from
mutations.json and MUTATIONS.md. Metrics, each with its command, are in metrics.json.
"""

import fnmatch
import glob
import json
import os
import re
import sys

import measured_errors
from tree_files import parser_of, read, write

FOLDER = os.path.join("tests", "hard_cases")
CASES, MUTATIONS, SEEN, PAGE, METRICS, MEASURED = (os.path.join(FOLDER, name) for name in (
    "cases.json", "mutations.json", "MUTATIONS.md", "RESULTS.md", "metrics.json", "measured.json"))
TEST = re.compile(r"\bTEST(?:_F|_P)?\(\s*(\w+)\s*,\s*(\w+)\s*\)")
CTEST = re.compile(r"add_(?:test\(NAME|tree_check\() ?(\w+)")
NUMBER = re.compile(r"(?<![A-Za-z0-9])([HF]\d+)(?![A-Za-z0-9])")
HEAD = """# Hard cases and faults

Every hard case, the tests that assert it, what they measured and what they allow, and the safeguard whose removal made one
of them fail ([MUTATIONS.md](MUTATIONS.md)). Written by `scripts/hard_cases.py` from the tests, `cases.json`, `measured.json`
and `metrics.json`; a test fails when this page is out of date, names a test that does not exist, or lacks a number that a
test measures. `ctest` shows whether the tests pass. Digits are correct decimal digits, -log10 of the relative error, the
worst of all inputs of the test; float and double are the precision of the computation.

{summary}
"""
PARTS = (("Numbers and pictures", "H"), ("Inputs, machines, programs", "F"))


class Tree:
    def __init__(self, root):
        self.root = root
        self.tests, self.of_case = set(), {}
        for path in sorted(glob.glob(os.path.join(root, "tests", "**", "*.[ch]*"), recursive=True)):
            for suite, name in TEST.findall(read(path)):
                self.add(f"{suite}.{name}", NUMBER.findall(name.replace("_", " ")))
        for path in glob.glob(os.path.join(root, "tests", "**", "CMakeLists.txt"), recursive=True):
            for name in CTEST.findall(read(path)):
                self.add(name, ())
        if glob.glob(os.path.join(root, "scripts", "check_*.py")):
            for checker in ("check_layers", "check_equations", "check_words", "check_names"):  # added by a loop in CMake
                self.add(checker, ())
        self.cases = json.loads(read(os.path.join(root, CASES)))
        self.safeguards = {}
        for entry in json.loads(read(os.path.join(root, MUTATIONS))):
            self.safeguards.setdefault(entry["case"], []).append(entry)
        self.seen = read(os.path.join(root, SEEN))
        self.metrics, self.measured = (json.loads(read(os.path.join(root, path)))
                                       if os.path.isfile(os.path.join(root, path)) else nothing
                                       for path, nothing in ((METRICS, []), (MEASURED, {})))

    def add(self, test, cases):
        self.tests.add(test)
        for case in cases:
            self.of_case.setdefault(case, []).append(test)

    def tests_of(self, case, complaints):
        """Names; a pattern with * must match a test."""
        names = sorted(self.of_case.get(case, []))
        for pattern in self.cases[case].get("tests", ()):
            if not fnmatch.filter(self.tests, pattern):
                complaints.append(f"{case}: no test is called {pattern}")
            if not any(fnmatch.fnmatchcase(name, pattern) for name in names):
                names.append(pattern)
        return names


def cell(text):
    return text.replace("|", "\\|").replace("<", "&lt;")


def shown(tests):
    """Test names; after the first of a suite, without the suite."""
    words, last = [], ""
    for test in tests:
        suite, _, name = test.partition(".")
        words.append(f"`{name}`" if name and suite == last else f"`{test}`")
        last = suite if name else ""
    return ", ".join(words)


def measured_by(measured, tests):
    """What these tests measured, as text."""
    return "; ".join(measured_errors.describe(row) for test in measured
                     if any(fnmatch.fnmatchcase(test, pattern) for pattern in tests) for row in measured[test])


def other_numbers(measured, listed):
    """What tests measured that belong to no case."""
    rows = [f"| `{test}` | {cell(measured_by(measured, [test]))} |" for test in measured if test not in listed]
    return "\n".join(["## Other measured numbers", "", "| test | measured |", "|---|---|", *rows]) if rows else ""


def metrics_table(metrics):
    lines = ["## Metrics", "",
             "Measured by the commands in the third column.", "",
             "| metric | measured | with | commit, machine |", "|---|---|---|---|"]
    lines += [f"| {cell(row['metric'])} | {cell(row['measured'])} | `{row['with']}` | {cell(row['at'])} |" for row in metrics]
    return "\n".join(lines)


def page(tree):
    """(text, complaints)"""
    complaints, tables, listed = [], [], set()
    count = {"tested": 0, "seen": 0, "cannot": 0, "untested": 0}
    for case in sorted(tree.of_case):
        if case not in tree.cases:
            complaints.append(f"{case}: a test has this number, {CASES} has not: {tree.of_case[case][0]}")
    for title, letter in PARTS:
        lines = [f"## {title}", "", "| case | | tests | measured | safeguard whose removal made a test fail |",
                 "|---|---|---|---|---|"]
        for case in (case for case in tree.cases if case[0] == letter):
            tests = tree.tests_of(case, complaints)
            safeguards = tree.safeguards.get(case, [])
            cannot = [entry["cannot_arise"] for entry in safeguards if "cannot_arise" in entry]
            why = cannot[0] if cannot else tree.cases[case].get("why", "")
            removed = "; ".join(entry["safeguard"] for entry in safeguards
                                if "safeguard" in entry and f"| {case} | {entry['safeguard']} |" in tree.seen)
            unseen = tree.cases[case].get("unseen", "")
            listed.update(test for test in tree.measured if any(fnmatch.fnmatchcase(test, name) for name in tests))
            if tests and not removed and not unseen:
                complaints.append(f"{case}: no safeguard was removed, and no reason is given")
            if removed and unseen:
                complaints.append(f"{case}: a safeguard was removed, and a reason why none can be")
            if not tests and not why:
                complaints.append(f"{case}: neither a test nor a reason why there is none")
            if tests and why:
                complaints.append(f"{case}: a test, and a reason why there is none")
            arises = not (cannot or why.startswith("cannot arise"))
            count["tested" if tests else "untested" if arises else "cannot"] += 1
            count["seen"] += bool(tests and removed)
            if cannot:
                why = "cannot arise: " + why
            lines.append(f"| {case} | {cell(tree.cases[case]['title'])} | {shown(tests) or cell(why)} | "
                         f"{cell(measured_by(tree.measured, tests))} | {cell(removed or unseen)} |")
        tables.append("\n".join(lines))
    summary = (f"{len(tree.cases)} cases: {count['tested']} have a test, and for {count['seen']} of these a test failed when a "
               f"safeguard was removed; {count['cannot']} cannot arise; {count['untested']} are not tested, with the reason.")
    summary = "\n\n".join(filter(None, (summary, measured_errors.summary(tree.measured))))
    tables += filter(None, [other_numbers(tree.measured, listed)])
    if tree.metrics:
        tables.insert(0, metrics_table(tree.metrics))
    return HEAD.format(summary=summary) + "\n" + "\n\n".join(tables) + "\n", complaints


def check(root):
    """Complaints."""
    tree = Tree(root)
    text, complaints = page(tree)
    complaints += measured_errors.complaints(root, tree.measured, tree.tests)
    path = os.path.join(root, PAGE)
    if not os.path.isfile(path) or read(path) != text:
        complaints.append(f"{PAGE} is not what scripts/hard_cases.py writes: run it")
    return complaints


def keep(root, reports):
    """Stores what the tests of these reports measured; of other tests that still exist the old numbers stay."""
    tree = Tree(root)
    build = os.path.isfile(os.path.join(reports[0], "CMakeCache.txt"))
    known = set(tree.measured) | set(measured_errors.in_sources(root)[0])
    now = measured_errors.run(reports[0], sorted(known)) if build else measured_errors.gather(reports)
    kept = {test: rows for test, rows in {**tree.measured, **now}.items() if test in tree.tests}
    rows = [f" {json.dumps(test)}: [\n  " + ",\n  ".join(json.dumps(row) for row in kept[test]) + "]"
            for test in sorted(kept)]
    write(os.path.join(root, MEASURED), "{\n" + ",\n".join(rows) + "\n}\n")


def write_page(root):
    """Writes the page; returns complaints."""
    text, complaints = page(Tree(root))
    write(os.path.join(root, PAGE), text)
    return complaints


def main():
    parser = parser_of(__doc__)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--measured", nargs="+", metavar="REPORT", help="store what tests measured")
    arguments = parser.parse_args()
    if arguments.measured:
        keep(arguments.root, arguments.measured)
    complaints = check(arguments.root) if arguments.check else write_page(arguments.root)
    for complaint in complaints:
        print(complaint)
    print(f"hard_cases: {len(complaints)} findings")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
