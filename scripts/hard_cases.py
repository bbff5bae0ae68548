#!/usr/bin/env python3
"""Prints the hard cases: each test that is named after one, whether it passed, and what it measured.

  hard_cases.py [build/cpu]          runs the tests of a build
  hard_cases.py REPORT.xml...        reads GoogleTest's reports, of a machine with a GPU for example
                                     (device_parity_test --gtest_output=xml:FILE)

A test belongs to the case whose number is in its name ("Mkl.H7_H20_StyleOfOneColour"); numbers are recorded by
tests/support/record_error.h. Digits are correct decimal digits, -log10 of the relative error, the worst of all inputs.

Exit status: 0, or 1 if a test failed.
"""

import argparse
import glob
import math
import os
import re
import subprocess
import sys
import tempfile
import xml.etree.ElementTree

CASE = re.compile(r"(?<![A-Za-z0-9])[HF]\d+(?![A-Za-z0-9])")
KEY = "measured: "


def cases_of(test):
    return CASE.findall(test.replace("_", " "))


def tests_of(program):
    """The tests of a program that are named after a case."""
    suite = ""
    for line in subprocess.run([program, "--gtest_list_tests"], check=True, capture_output=True, text=True).stdout.splitlines():
        word = line.split("#")[0].strip()
        if not line.startswith(" "):
            suite = word
        elif cases_of(word):
            yield suite + word


def run(build, reports):
    """Runs the tests that are named after a case, with a report for each program."""
    environment = dict(os.environ, OMP_WAIT_POLICY="passive")
    for program in sorted(glob.glob(os.path.join(build, "tests", "*", "*_test"))):
        report = os.path.join(reports, os.path.basename(program) + ".xml")
        if tests := ":".join(tests_of(program)):
            subprocess.run([program, "--gtest_brief=1", f"--gtest_filter={tests}", f"--gtest_output=xml:{report}"],
                           env=environment, stdout=sys.stderr, check=False)
    return sorted(glob.glob(os.path.join(reports, "*.xml")))


def describe(what, kind, number, place, measured, allowed):
    measured, allowed = float(measured), float(allowed)
    if kind == "count":
        return f"{what}: {measured:.0f}"
    if kind == "bits":
        return f"{what}: {'bitwise equal' if measured == 0 else 'DIFFERENT BITS'} ({number} {place})"
    if kind == "digits" and allowed > 0:
        right = f"{-math.log10(measured):.1f} digits" if measured > 0 else "exact"
        return f"{what}: {right} ({-math.log10(allowed):.1f} required; {number} {place})"
    return f"{what}: {measured:.2g} ({allowed:.2g} allowed; {number} {place})"


def rows_of(report):
    """(cases, test, [what it measured], whether it passed)"""
    for test in xml.etree.ElementTree.parse(report).getroot().iter("testcase"):
        name = test.get("classname").split("/")[-1] + "." + test.get("name")
        measured = [describe(entry.get("name")[len(KEY):], *entry.get("value").split())
                    for entry in test.iter("property") if entry.get("name").startswith(KEY)]
        if cases := cases_of(name):
            yield cases, name, measured, test.find("failure") is None


def order(row):
    case = row[0][0]
    return case[0] != "H", case[0], int(case[1:]), row[1]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("inputs", nargs="*", default=["build/cpu"], metavar="BUILD|REPORT.xml")
    inputs = parser.parse_args().inputs
    with tempfile.TemporaryDirectory() as folder:
        reports = run(inputs[0], folder) if os.path.isdir(inputs[0]) else inputs
        rows = sorted((row for report in reports for row in rows_of(report)), key=order)
    for cases, name, measured, passed in rows:
        print(" ".join(cases), name + ("" if passed else " FAILED"), *measured, sep="\t")
    failed = sum(not row[3] for row in rows)
    print(f"{len({case for row in rows for case in row[0]})} cases, {len(rows)} tests, {failed} failed")
    return 1 if failed or not rows else 0


if __name__ == "__main__":
    sys.exit(main())
