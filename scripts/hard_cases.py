#!/usr/bin/env python3
"""Writes tests/hard_cases/RESULTS.md: for each hard case and fault what is asserted, by which test, and whether that was seen.

  hard_cases.py             writes the page
  hard_cases.py --check     changes nothing; exit status 1 if the page is not what would be written, if a test that is
                            named does not exist, or if a case has neither a test nor a sentence why
  hard_cases.py --measured build/cpu
                            runs the tests of numbers in a build, keeps what they measured (measured.json), and writes the page
  hard_cases.py --measured REPORT.xml...
                            the same from GoogleTest's reports or folders of them: of tests that have begun to measure, and of
                            device_parity_test and device_style_test --gtest_output=xml:FILE on a machine with a GPU
  hard_cases.py --self-test plants mistakes and sees --check find them

A test belongs to a case whose number is in its name ("Mkl.H7_H20_StyleOfOneColour"). tests/hard_cases/cases.json has the
cases' titles, further tests ("tests": names with *, or of ctest), a sentence ("why") where there is none, and one ("unseen")
where no care can be taken out. What is asserted, and whether it was seen to fail, is taken from mutations.json and MUTATIONS.md
beside it. Measured figures of merit, each with its command, stand in figures.json.
"""

import argparse
import fnmatch
import glob
import json
import os
import re
import sys
import tempfile

import measured_errors

FOLDER = os.path.join("tests", "hard_cases")
CASES, CARES, SEEN, PAGE, FIGURES, MEASURED = (os.path.join(FOLDER, name) for name in (
    "cases.json", "mutations.json", "MUTATIONS.md", "RESULTS.md", "figures.json", "measured.json"))
TEST = re.compile(r"\bTEST(?:_F|_P)?\(\s*(\w+)\s*,\s*(\w+)\s*\)")
CTEST = re.compile(r"add_test\(NAME (\w+)")
NUMBER = re.compile(r"(?<![A-Za-z0-9])([HF]\d+)(?![A-Za-z0-9])")
HEAD = """# Hard cases and faults

Every case that the design names, the tests that assert it, what they measured beside what they allow, and the care that was
once taken out of the code to see one of them fail ([MUTATIONS.md](MUTATIONS.md)). Written by `scripts/hard_cases.py` from the
tests, from `cases.json` and `measured.json`; a test fails when this page is out of date, names a test that does not exist, or
lacks a number that a test measures. Whether the tests pass is said by `ctest`. Digits are correct decimal digits: -log10 of the
error over the size of what it is of, the worst of all that the test tries; float and double say what was computed in.

{summary}
"""
PARTS = (("Numbers and pictures", "H"), ("Inputs, machines, programs", "F"))


def read(path):
    with open(path, encoding="utf-8") as file:
        return file.read()


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
            for checker in ("check_layers", "check_equations"):  # made by a loop in CMake
                self.add(checker, ())
        self.cases = json.loads(read(os.path.join(root, CASES)))
        self.cares = {}
        for entry in json.loads(read(os.path.join(root, CARES))):
            self.cares.setdefault(entry["case"], []).append(entry)
        self.seen = read(os.path.join(root, SEEN))
        self.figures, self.measured = (json.loads(read(os.path.join(root, path)))
                                       if os.path.isfile(os.path.join(root, path)) else nothing
                                       for path, nothing in ((FIGURES, []), (MEASURED, {})))

    def add(self, test, cases):
        self.tests.add(test)
        for case in cases:
            self.of_case.setdefault(case, []).append(test)

    def tests_of(self, case, complaints):
        """Names, those with * resolved to be there."""
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
    """Test names; of a suite's later ones only what is behind its name."""
    words, last = [], ""
    for test in tests:
        suite, _, name = test.partition(".")
        words.append(f"`{name}`" if name and suite == last else f"`{test}`")
        last = suite if name else ""
    return ", ".join(words)


def measured_by(measured, tests):
    """What these tests measured, in words."""
    return "; ".join(measured_errors.told(row) for test in measured
                     if any(fnmatch.fnmatchcase(test, pattern) for pattern in tests) for row in measured[test])


def other_numbers(measured, told):
    """What tests measured that belong to no case."""
    rows = [f"| `{test}` | {cell(measured_by(measured, [test]))} |" for test in measured if test not in told]
    return "\n".join(["## Numbers of no case", "", "| test | measured |", "|---|---|", *rows]) if rows else ""


def metrics_table(figures):
    lines = ["## Figures of merit", "",
             "Measured by the commands beside them, which anyone can run.", "",
             "| figure | measured | with | commit, machine |", "|---|---|---|---|"]
    lines += [f"| {cell(row['figure'])} | {cell(row['measured'])} | `{row['with']}` | {cell(row['at'])} |" for row in figures]
    return "\n".join(lines)


def page(tree):
    """(text, complaints)"""
    complaints, tables, told = [], [], set()
    count = {"tested": 0, "seen": 0, "cannot": 0, "untested": 0}
    for case in sorted(tree.of_case):
        if case not in tree.cases:
            complaints.append(f"{case}: a test has this number, {CASES} has not: {tree.of_case[case][0]}")
    for title, letter in PARTS:
        lines = [f"## {title}", "", "| case | | tests | measured | care that was taken out, and seen to be missed |",
                 "|---|---|---|---|---|"]
        for case in (case for case in tree.cases if case[0] == letter):
            tests = tree.tests_of(case, complaints)
            cares = tree.cares.get(case, [])
            cannot = [entry["cannot_arise"] for entry in cares if "cannot_arise" in entry]
            why = cannot[0] if cannot else tree.cases[case].get("why", "")
            said = "; ".join(entry["care"] for entry in cares
                             if "care" in entry and f"| {case} | {entry['care']} |" in tree.seen)
            unseen = tree.cases[case].get("unseen", "")
            told.update(test for test in tree.measured if any(fnmatch.fnmatchcase(test, name) for name in tests))
            if tests and not said and not unseen:
                complaints.append(f"{case}: no test was seen to fail, and no sentence says why")
            if said and unseen:
                complaints.append(f"{case}: a test was seen to fail, and a sentence why none can be")
            if not tests and not why:
                complaints.append(f"{case}: neither a test nor a sentence why there is none")
            if tests and why:
                complaints.append(f"{case}: a test, and a sentence why there is none")
            arises = not (cannot or why.startswith("cannot arise"))
            count["tested" if tests else "untested" if arises else "cannot"] += 1
            count["seen"] += bool(tests and said)
            if cannot:
                why = "cannot arise: " + why
            lines.append(f"| {case} | {cell(tree.cases[case]['title'])} | {shown(tests) or cell(why)} | "
                         f"{cell(measured_by(tree.measured, tests))} | {cell(said or unseen)} |")
        tables.append("\n".join(lines))
    summary = (f"{len(tree.cases)} cases: {count['tested']} have a test, {count['seen']} of these were seen to fail without their "
               f"care; {count['cannot']} cannot arise here; {count['untested']} are not tested, and it is said why.")
    summary = "\n\n".join(filter(None, (summary, measured_errors.summary(tree.measured))))
    tables += filter(None, [other_numbers(tree.measured, told)])
    if tree.figures:
        tables.insert(0, metrics_table(tree.figures))
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
    """Of tests that ran what they measured now, of others what is kept, as long as they are there."""
    tree = Tree(root)
    build = os.path.isfile(os.path.join(reports[0], "CMakeCache.txt"))
    known = set(tree.measured) | set(measured_errors.in_sources(root)[0])
    now = measured_errors.run(reports[0], sorted(known)) if build else measured_errors.gather(reports)
    kept = {test: rows for test, rows in {**tree.measured, **now}.items() if test in tree.tests}
    with open(os.path.join(root, MEASURED), "w", encoding="utf-8") as file:
        rows = [f" {json.dumps(test)}: [\n  " + ",\n  ".join(json.dumps(row) for row in kept[test]) + "]"
                for test in sorted(kept)]
        file.write("{\n" + ",\n".join(rows) + "\n}\n")


def self_test():
    tidy = {"H1": {"title": "one"}, "F1": {"title": "two", "tests": ["S.*", "by_ctest"], "unseen": "no"},
            "F2": {"title": "three", "why": "not tested: no"}}
    cares = [{"case": "H1", "care": "c"}]
    row = {"what": "sums", "kind": "digits", "where": "double CPU", "measured": "1e-15", "allowed": "1e-14"}
    good = {"S.H1_C": [row]}
    planted = [({}, good, ""),
               ({"F1": {"title": "two", "tests": ["T.*"], "unseen": "no"}}, good, "no test is called T.*"),
               ({"F2": {"title": "three"}}, good, "neither a test"),
               ({"H1": {"title": "one", "why": "no"}}, good, "a test, and a sentence why there"),
               ({"H1": {"title": "one", "unseen": "no"}}, good, "a sentence why none can be"),
               ({"F1": {"title": "two", "tests": ["S.*"]}}, good, "no sentence says why"),
               ({"H1": None}, good, "a test has this number"),
               ({}, {}, "S.H1_C measures, and stands in no"),
               ({}, {**good, "S.Gone": [row]}, "which no test is called"),
               ({}, {"S.H1_C": [row, {**row, "what": "means"}]}, "does not measure it"),
               ({}, {"S.H1_C": [{**row, "what": "su"}]}, "which measured.json does not have")]
    failures = 0
    for change, measured, expected in planted:
        with tempfile.TemporaryDirectory() as root:
            cases = {case: row for case, row in {**tidy, **change}.items() if row}
            files = {CASES: json.dumps(cases), CARES: json.dumps(cares), SEEN: "| H1 | c | S.H1_C | no |",
                     MEASURED: json.dumps(measured), "tests/CMakeLists.txt": "add_test(NAME by_ctest COMMAND x)",
                     "tests/s_test.cc": "TEST(S, H1_C) {\n  RecordDigits(\"sums\", 1);\n}\n"}
            for path, text in files.items():
                os.makedirs(os.path.dirname(os.path.join(root, path)), exist_ok=True)
                with open(os.path.join(root, path), "w", encoding="utf-8") as file:
                    file.write(text)
            with open(os.path.join(root, PAGE), "w", encoding="utf-8") as file:
                file.write(page(Tree(root))[0])
            found = check(root)
            with open(os.path.join(root, PAGE), "a", encoding="utf-8") as file:
                file.write("more\n")
            stale = any("is not what" in text for text in check(root))
        if not stale or bool(found) != bool(expected) or (expected and expected not in found[0]):
            failures += 1
            print(f"self-test: expected '{expected}', got {found}")
    print(f"self-test: {len(planted)} lists, {failures} failures")
    return failures


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", default=os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--self-test", action="store_true")
    parser.add_argument("--measured", nargs="+", metavar="REPORT", help="gather what tests measured, and keep it")
    arguments = parser.parse_args()
    if arguments.self_test:
        return 1 if self_test() else 0
    if arguments.measured:
        keep(arguments.root, arguments.measured)
    if arguments.check:
        complaints = check(arguments.root)
    else:
        text, complaints = page(Tree(arguments.root))
        with open(os.path.join(arguments.root, PAGE), "w", encoding="utf-8") as file:
            file.write(text)
    for complaint in complaints:
        print(complaint)
    print(f"hard_cases: {len(complaints)} findings")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
