#!/usr/bin/env python3
"""Plants mistakes in the table of hard cases; hard_cases.py --check must find each, and a page that is out of date."""

import json
import unittest

from planted_tree import planted

import hard_cases

TIDY = {"H1": {"title": "one"}, "F1": {"title": "two", "tests": ["S.*", "by_ctest"], "unseen": "no"},
        "F2": {"title": "three", "why": "not tested: no"}}
SAFEGUARDS = [{"case": "H1", "safeguard": "c"}]
ROW = {"what": "sums", "kind": "digits", "where": "double CPU", "measured": "1e-15", "allowed": "1e-14"}
GOOD = {"S.H1_C": [ROW]}
PLANTED = [({}, GOOD, ""),
           ({"F1": {"title": "two", "tests": ["T.*"], "unseen": "no"}}, GOOD, "no test is called T.*"),
           ({"F2": {"title": "three"}}, GOOD, "neither a test"),
           ({"H1": {"title": "one", "why": "no"}}, GOOD, "a test, and a reason why there"),
           ({"H1": {"title": "one", "unseen": "no"}}, GOOD, "a reason why none can be"),
           ({"F1": {"title": "two", "tests": ["S.*"]}}, GOOD, "no reason is given"),
           ({"H1": None}, GOOD, "a test has this number"),
           ({}, {}, "S.H1_C measures, but is not in"),
           ({}, {**GOOD, "S.Gone": [ROW]}, "but there is no such test"),
           ({}, {"S.H1_C": [ROW, {**ROW, "what": "means"}]}, "does not measure"),
           ({}, {"S.H1_C": [{**ROW, "what": "su"}]}, "which measured.json does not have")]


class HardCases(unittest.TestCase):
    def test_planted(self):
        for change, measured, expected in PLANTED:
            cases = {case: row for case, row in {**TIDY, **change}.items() if row}
            files = {hard_cases.CASES: json.dumps(cases), hard_cases.MUTATIONS: json.dumps(SAFEGUARDS),
                     hard_cases.SEEN: "| H1 | c | S.H1_C | no |", hard_cases.MEASURED: json.dumps(measured),
                     "tests/CMakeLists.txt": "add_test(NAME by_ctest COMMAND x)",
                     "tests/s_test.cc": "TEST(S, H1_C) {\n  RecordDigits(\"sums\", 1);\n}\n"}
            with self.subTest(expected), planted(files) as root:
                hard_cases.write_page(root)
                found = hard_cases.check(root)
                self.assertEqual(bool(found), bool(expected), found)
                self.assertIn(expected, "".join(found[:1]))
                with open(f"{root}/{hard_cases.PAGE}", "a", encoding="utf-8") as file:
                    file.write("more\n")
                self.assertTrue(any("is not what" in text for text in hard_cases.check(root)))


if __name__ == "__main__":
    unittest.main()
