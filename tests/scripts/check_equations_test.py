#!/usr/bin/env python3
"""Plants one mistake at a time in a correct tree; check_equations.py must find each, and nothing in the correct tree."""

import unittest

from planted_tree import planted

import check_equations

PAPER = ("\n" + check_equations.PAPER_HEADING + "\n\n| item | place, or why not |\n|---|---|\n"
         + "".join(f"| {item} | `one` |\n" for item in check_equations.PAPER_ITEMS))
TIDY = {
    "kernels/field/a.h": "// EQ(one): x = y.\n// As in (see EQ(two)), above.\n// EQ(two), after Max: a | b.\n",
    "tests/a_test.cc": "TEST(A, One) { EXPECT_EQ(two); }\nTEST_F(A,\n       Two) {}\n// see EQ(one): tested\n",
    "EQUATIONS.md": "| tag | equation | source | file | tests |\n|---|---|---|---|---|\n"
                    "| `one` | x = y | us | `kernels/field/a.h` | `A.One` |\n"
                    "| `two` | a \\| b | Max | `kernels/field/a.h` | `A.One`, `A.Two` |\n" + PAPER,
}
TABLE = TIDY["EQUATIONS.md"]
PLANTED = (
    ({"kernels/field/b.h": "// EQ(one): x = y.\n"}, "2 homes"),
    ({"kernels/field/b.h": "// EQ(three): z.\n"}, "no row"),
    ({"kernels/field/b.h": "// see EQ(four).\n"}, "is not stated"),
    ({"EQUATIONS.md": TABLE.replace("| eq. 3 | `one` |\n", "")}, "eq. 3 of the paper has 0 rows"),
    ({"EQUATIONS.md": TABLE.replace("| eq. 3 | `one` |", "| eq. 3 | |")}, "eq. 3"),
    ({"EQUATIONS.md": TABLE.replace("| eq. 3 | `one` |", "| eq. 3 | `a/none.h` |")}, "there is no a/none.h"),
    ({"EQUATIONS.md": TABLE.replace(PAPER, "| `five` | x | us | `kernels/field/a.h` | `A.One` |\n" + PAPER)}, "is not stated"),
    ({"EQUATIONS.md": TABLE.replace(PAPER, TABLE.splitlines()[2] + "\n" + PAPER)}, "second row"),
    ({"EQUATIONS.md": TABLE.replace("a.h` | `A.One` |", "z.h` | `A.One` |")}, "lives in"),
    ({"EQUATIONS.md": TABLE.replace("`A.Two`", "`A.Three`")}, "no test A.Three"),
    ({"EQUATIONS.md": TABLE.replace("a.h` | `A.One` |", "a.h` | |")}, "names no test"),
    ({"EQUATIONS.md": TABLE.replace("\\|", "|")}, "6 cells"),
)


class CheckEquations(unittest.TestCase):
    def test_planted(self):
        for extra, expected in (({}, ""),) + PLANTED:
            with self.subTest(expected), planted({**TIDY, **extra}) as root:
                found = check_equations.check_tree(root)
                self.assertEqual(len(found), bool(expected), found)
                self.assertIn(expected, "".join(found))


if __name__ == "__main__":
    unittest.main()
