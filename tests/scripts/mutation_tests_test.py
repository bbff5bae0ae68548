#!/usr/bin/env python3
"""Plants mistakes, renames and moves; mutation_tests.py --check and --rebase must find them."""

import json
import unittest

from planted_tree import planted

import mutation_tests

GOOD = {"case": "H1", "safeguard": "s", "file": "a.cc", "find": "one", "replace": "r", "target": "t", "tests": "*S.C*"}
MISTAKES = [({}, ""), ({"find": "twice"}, "occurs 2 times"), ({"find": "none"}, "occurs 0 times"),
            ({"find": "on"}, "occurs 0 times"), ({"find": " "}, "occurs 0 times"),
            ({"file": "b.cc"}, "occurs 0 times"), ({"replace": " one"}, "are the same"),
            ({"tests": "X.*"}, "no test is called"), ({"more": ""}, "an entry has"), ({"case": "H0"}, "not one of")]
# snippet, text, the text with X for the snippet; None: not found
FIND = (("a = f(b, c);", "  a =\n      f( b,c );  // d\n", "  X  // d\n"),
        ("a = f(b,\n      c);", "a = f(b, c);\n", "X\n"),
        ("return x", "return\n x;", "X;"),
        ("return x", "returnx; return x2; my_return x;", None),
        ("x", "x2 ax a_x", None),
        ("  a();\n", "b();  // keep\n  a();\n  c();\n", "b();  // keep\nXc();\n"),
        ("a.b", "a_b", None), (r"\d", r"f(\d)", "f(X)"))
MOVED = {"case": "H1", "safeguard": "s", "file": "a.cc", "find": "if (weight < kLeast) continue;", "replace": "",
         "target": "t", "tests": "S.C"}
OTHER = "int main() {\n  return 0;\n}\n"
REBASE = (({"a.cc": "for (;;) {\n  if (weight < kLeast) continue;\n}\n"}, None),
          ({"a.cc": OTHER + "  if (object_weight < kLeast) continue;\n"}, "a.cc:4 ("),
          ({"a.cc": OTHER, "b/c.h": "if (weight <\n    kLeast) continue;\n"}, 'moved: "file": "b/c.h"'),
          ({"a.cc": OTHER, "b/c.h": "x();\nif (w < kLeast) continue;\n"}, "b/c.h:2 ("),
          ({"a.cc": OTHER}, "nothing similar"),
          ({"a.cc": MOVED["find"], "tests/t.cc": "TEST(S, Cc)\n"}, "nearest: S.Cc"))


class MutationTests(unittest.TestCase):
    def test_check(self):
        tidy = [{"case": case, "cannot_arise": "no"} for case in mutation_tests.all_cases()]
        lists = [(tidy + [{**GOOD, **change}], expected) for change, expected in MISTAKES] + [(tidy[1:], "H1: no entry")]
        for entries, expected in lists:
            files = {mutation_tests.ENTRIES: json.dumps(entries), "a.cc": "one twice twice", "tests/t.cc": "TEST(S, C)"}
            with self.subTest(expected), planted(files) as root:
                found = mutation_tests.check(root)[1]
                self.assertEqual(len(found), bool(expected), found)
                self.assertIn(expected, "".join(found))

    def test_find(self):
        """White space of any amount matches, identifiers match exactly."""
        for find, text, expected in FIND:
            result, count = mutation_tests.mutated(text, {"find": find, "replace": "X"})
            self.assertEqual(result if count else None, expected, find)

    def test_rebase(self):
        for files, expected in REBASE:
            with self.subTest(expected), planted({"tests/t.cc": "TEST(S, C)", **files}) as root:
                report = mutation_tests.rebase(root, [MOVED])
                self.assertEqual(bool(report), bool(expected), report)
                self.assertTrue(not expected or any(expected in line for line in report), report)


if __name__ == "__main__":
    unittest.main()
