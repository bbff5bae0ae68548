#!/usr/bin/env python3
"""Mutation tests: changes one line of a source at a time, and a test must fail.

  mutation_tests.py stylize/image/monge_kantorovich.cc:40-80 --target stylize_image_test --filter 'Mkl.*'

A mutant removes a condition or a throw, or exchanges an operator. It is built in the build folder of the tree; the file
is put back afterwards, after Ctrl-C too. A mutant that survives is printed with its line: either a test is missing, or the
line does nothing.

Exit status: 0 if every mutant was noticed, else 1.
"""

import argparse
import glob
import pathlib
import re
import subprocess
import sys

RULES = [  # (name, pattern, replacement)
    ("condition never holds", r"\bif \((?!constexpr)(.*)\)( \{|$)", r"if (false && (\1))\2"),
    ("condition always holds", r"\bif \((?!constexpr)(.*)\)( \{|$)", r"if (true || (\1))\2"),
    ("no throw", r"^(\s*)throw .*;$", r"\1;"),
    ("no limit", r"\bstd::(?:max|min)(?:<\w+>)?\(([^,()]+), ([^,()]+)\)", r"(\2)"),
    ("<= for <", r" < ", " <= "), ("< for <=", r" <= ", " < "),
    (">= for >", r" > ", " >= "), ("> for >=", r" >= ", " > "),
    ("|| for &&", r" && ", " || "), ("&& for ||", r" \|\| ", " && "),
    ("- for +", r" \+ ", " - "), ("+ for -", r" - ", " + "),
]


def mutants(lines, first, last):
    """(number of the line, name of the rule, changed line)"""
    for number in range(first, min(last, len(lines)) + 1):
        line = lines[number - 1]
        if line.lstrip().startswith(("//", "#")):
            continue
        for name, pattern, replacement in RULES:
            changed, count = re.subn(pattern, replacement, line, count=1)
            if count and changed != line:
                yield number, name, changed


def passes(command, seconds=None):
    try:
        return subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                              timeout=seconds, check=False).returncode == 0
    except subprocess.TimeoutExpired:
        return False


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", metavar="FILE[:FIRST[-LAST]]")
    parser.add_argument("--target", required=True, help="the test program")
    parser.add_argument("--filter", default="*", help="its tests, as --gtest_filter takes them (*)")
    parser.add_argument("--build", default="build/cpu", help="the build folder (build/cpu)")
    parser.add_argument("--seconds", type=float, default=120, help="a test that runs longer has failed (120)")
    arguments = parser.parse_args()
    name, _, span = arguments.source.partition(":")
    first, _, last = span.partition("-")
    path = pathlib.Path(name)
    text = path.read_text(encoding="utf-8")
    lines = text.split("\n")
    make = ["cmake", "--build", arguments.build, "--target", arguments.target]

    def test():
        program = glob.glob(f"{arguments.build}/tests/*/{arguments.target}")
        return passes(program + [f"--gtest_filter={arguments.filter}", "--gtest_brief=1"], arguments.seconds)

    if not passes(make) or not test():
        sys.exit(f"{arguments.target} fails without a mutant")
    tried = survived = 0
    try:
        for number, rule, changed in mutants(lines, int(first or 1), int(last or first or len(lines))):
            path.write_text("\n".join(lines[:number - 1] + [changed] + lines[number:]), encoding="utf-8")
            if not passes(make):
                continue  # does not compile
            tried += 1
            if test():
                survived += 1
                print(f"{path}:{number}: survived: {rule}: {lines[number - 1].strip()}", flush=True)
    finally:
        path.write_text(text, encoding="utf-8")
        passes(make)
    print(f"{tried} mutants, {survived} survived")
    return 1 if survived or not tried else 0


if __name__ == "__main__":
    sys.exit(main())
