#!/usr/bin/env python3
"""Reads the numbers that tests measured from GoogleTest's reports and writes them as text; a module of hard_cases.py.

Tests record numbers with tests/support/record_error.h. hard_cases.py --measured stores them in
tests/hard_cases/measured.json: {test: [{what, kind, where, measured, allowed}]}, of a test with parameters the worst.
Kinds: "count" is a number of inputs, "digits" a relative error, "bound" a number with an upper limit, "bits" 0 where two
results are bitwise equal. The last digits depend on machine and compiler: the check against the sources compares which
tests record which quantities, not the numbers.
"""

import glob
import math
import os
import re
import subprocess
import tempfile
import xml.etree.ElementTree

from tree_files import read

TEST = re.compile(r"^TEST(?:_F|_P)?\(\s*(\w+)\s*,\s*(\w+)\s*\)(.*?)^\}", re.M | re.S)
RECORD = re.compile(r"\bRecord(?:Digits|Bound|SameBits)\(\s*(?:\"((?:[^\"\\]|\\.)*)\")?")
KEY = "measured: "


def fraction_of_limit(row):
    """measured / allowed; of bits, whether any differs."""
    measured, allowed = float(row["measured"]), float(row["allowed"])
    return measured / allowed if allowed > 0 else measured


def gather(paths):
    """{test: rows} of reports, or of folders of reports; an incomplete report is an error."""
    found = {}
    for path in paths:
        for report in sorted(glob.glob(os.path.join(path, "*.xml"))) if os.path.isdir(path) else [path]:
            for case in xml.etree.ElementTree.parse(report).getroot().iter("testcase"):
                rows = [(entry.get("name")[len(KEY):], entry.get("value").split())
                        for entry in case.iter("property") if entry.get("name").startswith(KEY)]
                test = case.get("classname").split("/")[-1] + "." + case.get("name").split("/")[0]
                for what, (kind, number, place, measured, allowed) in rows:
                    row = {"what": what, "kind": kind, "where": f"{number} {place}", "measured": measured,
                           "allowed": allowed}
                    last = found.setdefault(test, {}).get(what)
                    if last is None or fraction_of_limit(row) > fraction_of_limit(last):
                        found[test][what] = row
    return {test: [rows[what] for what in sorted(rows)] for test, rows in sorted(found.items())}


def run(build, tests):
    """Runs these tests in the test programs of a build and gathers; a failing test is an error."""
    with tempfile.TemporaryDirectory() as reports:
        for program in sorted(glob.glob(os.path.join(build, "tests", "*", "*_test"))):
            listed = subprocess.run([program, "--gtest_list_tests"], check=True, capture_output=True, text=True).stdout
            suites = set(re.findall(r"^(?:\w+/)?(\w+)(?:/\d+)?\.", listed, re.M))
            wanted = [test for test in tests if test.split(".")[0] in suites]
            if wanted:
                names = ":".join(f"{test}:*/{test}/*" for test in wanted)
                subprocess.run([program, "--gtest_brief=1", f"--gtest_filter={names}",
                                f"--gtest_output=xml:{reports}/{os.path.basename(program)}.xml"], check=True,
                               env=dict(os.environ, OMP_WAIT_POLICY="passive"))
        return gather([reports])


def in_sources(root):
    """({test: [beginning of each quantity's name]}, {tests that need a GPU}); helper functions are not searched."""
    recorded, on_gpu = {}, set()
    for path in sorted(glob.glob(os.path.join(root, "tests", "**", "*_test.cc"), recursive=True)):
        for suite, name, body in TEST.findall(read(path)):
            test = f"{suite}.{name}"
            if os.sep + "gpu" + os.sep in path:
                on_gpu.add(test)
            begins = RECORD.findall(body)
            if begins:
                recorded[test] = [begin.replace("\\\"", "\"") for begin in begins]
    return recorded, on_gpu


def complaints(root, measured, tests):
    """Differences between the sources and measured.json in what is measured."""
    recorded, on_gpu = in_sources(root)
    found = [f"{test} measures, but is not in measured.json: see hard_cases.py --measured"
             for test in recorded if test not in measured and test not in on_gpu]
    found += [f"measured.json has {test}, but there is no such test" for test in measured if test not in tests]
    for test in set(recorded) & set(measured):
        whats = [row["what"] for row in measured[test]]
        found += [f"{test} measures '{begin}', which measured.json does not have" for begin in recorded[test]
                  if not any(what.startswith(begin) for what in whats)]
        found += [f"measured.json has '{what}', which {test} does not measure" for what in whats
                  if not any(what.startswith(begin) for begin in recorded[test])]
    return sorted(found)


def digits(row):
    """Correct decimal digits; None for other kinds and for an error of 0."""
    measured = float(row["measured"])
    return -math.log10(measured) if row["kind"] == "digits" and measured > 0 else None


def number(text):
    value = float(text)
    return f"{value:.2g}" if value == 0 or 1e-2 <= abs(value) < 1e4 else f"{value:.1e}"


def describe(row):
    """One row as text."""
    if row["kind"] == "count":
        return f"{row['what']}: {row['measured']}"
    if row["kind"] == "bits":
        return f"{row['what']}: bitwise equal ({row['where']})"
    if row["kind"] == "digits":
        required = -math.log10(float(row["allowed"]))
        right = "exact" if digits(row) is None else f"{digits(row):.1f} digits"
        return f"{row['what']}: {right} ({required:.1f} required; {row['where']})"
    return f"{row['what']}: {number(row['measured'])} ({number(row['allowed'])} allowed; {row['where']})"


def summary(measured):
    """The count of numbers, and the least and mean digits of each precision; '' without numbers."""
    rows = [row for rows in measured.values() for row in rows]
    if not rows:
        return ""
    words = []
    for where in ("double CPU", "float CPU", "float GPU"):
        of = [digits(row) for row in rows if row["where"] == where and digits(row) is not None]
        if of:
            words.append(f"in {where.replace(' CPU', '').replace(' GPU', ' on the GPU')} at least {min(of):.1f} digits "
                         f"and {sum(of) / len(of):.1f} on average over {len(of)} errors")
    same = sum(row["kind"] == "bits" for row in rows)
    bounds = sum(row["kind"] == "bound" for row in rows)
    return (f"Tests measured {len(rows)} numbers: " + "; ".join(words) +
            f"; {bounds} below a bound; {same} pairs of bitwise equal results.")
