#!/usr/bin/env python3
"""Plants names that do not exist, one at a time, in a correct tree; check_names.py must find each."""

import re
import unittest

from planted_tree import planted

import check_names

TIDY = {
    "kernels/base/vec.h": "", "kernels/base/view.h": "", "assets/a.png": "", "tests/hard/RESULTS.md": "",
    "CHANGELOG.md": "`kernels/old.h` went\n",
    "scripts/run.py": "\"\"\"Reads kernels/base/vec.h; see run.py.\"\"\"\nX = r\"kernels/base/(vec|view)\\.h\"\n"
                      "Y = r\"kernels/.*\\.h\", \"omp.h\"\n",
    "pipeline/a.cc": "bind(\"fit-steps\", steps);\n",
    "scripts/all.sh": "\"$root/scripts/run.py\"\nkernels=$build/kernels/x --out build/cpu/tests/x\n",
    "README.md": "`kernels/base/{vec,view}.h`, `kernels/base/`, `scripts/*.py`, [results](tests/hard/RESULTS.md#a), "
                 "https://x.org/kernels/x.h, vec.h, report.html. In kernels/base. To tests/hard/TARGET/. With --fit-steps 3, --out.\n",
}
PLANTED = (
    ("README.md", "`kernels/base/{vec,wide}.h`\n", "kernels/base/wide.h"),
    ("README.md", "In kernels/math, too.\n", "kernels/math"),
    ("README.md", "`scripts/*.pl`\n", "scripts/*.pl"),
    ("README.md", "see [there](tests/RESULTS.md)\n", "tests/RESULTS.md"),
    ("tests/hard/MORE.md", "see [there](WORSE.md)\n", "WORSE.md"),
    ("README.md", "`jump.py` runs\n", "jump.py"),
    ("README.md", "With\n`--fit-stairs 3`, --fit-steps 2\n", "option --fit-stairs"),
    ("scripts/a.py", "\"\"\"a.py --gone\"\"\"\nx = \"--there\"  # --there\n", "option --gone"),
    ("scripts/a.py", "\"\"\"Reads kernels/none.h.\"\"\"\n", "kernels/none.h"),
    ("scripts/a.py", "x = 1  # see other.py\n", "other.py"),
    ("scripts/a.py", "X = (r\"reach/.*\",\n     r\"kernels/base/none\\.h\")\n", "kernels/base/none.h"),
    ("scripts/a.sh", "python3 \"$root/scripts/gone.py\"\n", "scripts/gone.py"),
    ("scripts/a.sh", "python3 scripts/gone.py\n", "scripts/gone.py"),
)


class CheckNames(unittest.TestCase):
    def test_planted(self):
        for path, text, expected in (("", "", ""),) + PLANTED:
            with self.subTest(expected), planted({**TIDY, **({path: text} if path else {})}) as root:
                line = text[:text.find(re.split("[/ ]", expected)[-1])].count("\n") + 1
                self.assertEqual(check_names.Tree(root).check(), [(path, line, expected)] if expected else [])


if __name__ == "__main__":
    unittest.main()
