#!/usr/bin/env python3
"""What tests of numbers measured, gathered from GoogleTest's reports, and told in words.

Tests measure with tests/support/record_error.h. hard_cases.py --measured gathers and keeps it in
tests/hard_cases/measured.json: {test: [{what, kind, where, measured, allowed}]}, of a test with parameters the worst.
Kinds: "count" is how many there were, "digits" is an error relative to the size of what it is of, "bound" anything that stays below what is allowed,
"bits" 0 where two results are the same to the last bit. A number may differ by machine and compiler in its last digits:
what is compared with the sources is which tests measure, and what.
"""

import glob
import math
import os
import re
import subprocess
import tempfile
import xml.etree.ElementTree

TEST = re.compile(r"^TEST(?:_F|_P)?\(\s*(\w+)\s*,\s*(\w+)\s*\)(.*?)^\}", re.M | re.S)
RECORD = re.compile(r"\bRecord(?:Digits|Bound|SameBits)\(\s*(?:\"((?:[^\"\\]|\\.)*)\")?")
KEY = "measured: "


def share(row):
    """How near to what is allowed; of bits, whether any differs."""
    measured, allowed = float(row["measured"]), float(row["allowed"])
    return measured / allowed if allowed > 0 else measured


def gather(paths):
    """{test: rows} of reports, or of folders of reports; a report that is not whole is an error."""
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
                    if last is None or share(row) > share(last):
                        found[test][what] = row
    return {test: [rows[what] for what in sorted(rows)] for test, rows in sorted(found.items())}


def run(build, tests):
    """Runs those of a build's test programs that have some of these tests, and gathers; a test that fails is an error."""
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
    """({test: [beginning of what it measures]}, {tests that need a GPU}); helpers of tests have none of their own."""
    recorded, on_gpu = {}, set()
    for path in sorted(glob.glob(os.path.join(root, "tests", "**", "*_test.cc"), recursive=True)):
        with open(path, encoding="utf-8") as file:
            text = file.read()
        for suite, name, body in TEST.findall(text):
            test = f"{suite}.{name}"
            if os.sep + "gpu" + os.sep in path:
                on_gpu.add(test)
            begins = RECORD.findall(body)
            if begins:
                recorded[test] = [begin.replace("\\\"", "\"") for begin in begins]
    return recorded, on_gpu


def complaints(root, measured, tests):
    """Where sources and measured.json disagree about what is measured."""
    recorded, on_gpu = in_sources(root)
    found = [f"{test} measures, and stands in no measured.json: see hard_cases.py --measured"
             for test in recorded if test not in measured and test not in on_gpu]
    found += [f"measured.json has {test}, which no test is called" for test in measured if test not in tests]
    for test in set(recorded) & set(measured):
        whats = [row["what"] for row in measured[test]]
        found += [f"{test} measures '{begin}', which measured.json does not have" for begin in recorded[test]
                  if not any(what.startswith(begin) for what in whats)]
        found += [f"measured.json has '{what}' of {test}, which does not measure it" for what in whats
                  if not any(what.startswith(begin) for begin in recorded[test])]
    return sorted(found)


def digits(row):
    """Correct decimal digits; None where that is not what is measured."""
    measured = float(row["measured"])
    return -math.log10(measured) if row["kind"] == "digits" and measured > 0 else None


def number(text):
    value = float(text)
    return f"{value:.2g}" if value == 0 or 1e-2 <= abs(value) < 1e4 else f"{value:.1e}"


def told(row):
    """One row in words."""
    if row["kind"] == "count":
        return f"{row['what']}: {row['measured']}"
    if row["kind"] == "bits":
        return f"{row['what']}: no bit differs ({row['where']})"
    if row["kind"] == "digits":
        asked = -math.log10(float(row["allowed"]))
        right = "exact" if digits(row) is None else f"{digits(row):.1f} digits"
        return f"{row['what']}: {right} ({asked:.1f} asked; {row['where']})"
    return f"{row['what']}: {number(row['measured'])} ({number(row['allowed'])} allowed; {row['where']})"


def summary(measured):
    """How many numbers, and the fewest and mean digits of each precision; '' of nothing."""
    rows = [row for rows in measured.values() for row in rows]
    if not rows:
        return ""
    words = []
    for where in ("double CPU", "float CPU", "float GPU"):
        of = [digits(row) for row in rows if row["where"] == where and digits(row) is not None]
        if of:
            words.append(f"in {where.replace(' CPU', '').replace(' GPU', ' on the GPU')} {min(of):.1f} digits at least "
                         f"and {sum(of) / len(of):.1f} on average over {len(of)} errors")
    same = sum(row["kind"] == "bits" for row in rows)
    bounds = sum(row["kind"] == "bound" for row in rows)
    return (f"Tests measured {len(rows)} numbers: " + "; ".join(words) +
            f"; {bounds} that stay below a bound; {same} results that agree to the last bit.")
