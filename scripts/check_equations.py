#!/usr/bin/env python3
"""Checks that each equation is stated once in the sources, has one row in EQUATIONS.md, and a test that exists; and that
each numbered item of the paper has one row there, with a place that exists or the reason why it has none.

  check_equations.py [--root DIR]   checks the tree; one line for each finding

An equation is stated in a comment with EQ(tag) followed by a comma or a colon; other places write "see EQ(tag)".
Exit status: 0, or 1 if there is a finding.
"""

import os
import re
import sys

from tree_files import parser_of, read

MODULES = ("kernels", "reconstruct", "stylize", "evaluate", "pipeline")
TAG = re.compile(r"(?<![A-Za-z0-9_])EQ\(([a-z][a-z0-9-]*)\)")
TEST = re.compile(r"\bTEST(?:_F|_P)?\(\s*(\w+)\s*,\s*(\w+)\s*\)|\bTYPED_TEST(?:_P)?\(\s*(\w+)\s*,\s*(\w+)\s*\)")
PAPER_HEADING = "## LipRF, item by item"
PAPER_ITEMS = ([f"eq. {n}" for n in range(1, 16)] + [f"proposition {n}" for n in (1, 2, 3)] + ["lemma 1", "lemma 2"]
               + [f"proof of {of}" for of in ("proposition 1", "lemma 1", "proposition 2", "lemma 2", "proposition 3")]
               + ["remark of lemma 2", "remarks of proposition 3"]
               + [f"algorithm 1, step {n}" for n in range(4)] + ["table 1"] + [f"figure {n}" for n in range(1, 9)]
               + ["user study", "video"])
TABLE_COLUMNS = 5  # tag, equation, source, file, tests


def source_files(root, modules):
    for module in modules:
        for folder, subfolders, names in os.walk(os.path.join(root, module)):
            subfolders.sort()
            for name in sorted(names):
                if name.endswith((".h", ".cuh", ".cc", ".cu")):
                    path = os.path.join(folder, name)
                    yield os.path.relpath(path, root).replace(os.sep, "/"), read(path)


def homes_and_references(root):
    """({tag: [(path, line)]}, {tag: [(path, line)]}): where an equation is stated, and where it is referred to."""
    homes, references = {}, {}
    for path, text in source_files(root, MODULES + ("tests",)):
        for number, line in enumerate(text.splitlines(), 1):
            for match in TAG.finditer(line):
                in_comment = re.search(r"//|/\*|^\s*\*", line[:match.start()]) is not None
                stated = line[match.end():].startswith((",", ":"))
                referred = re.search(r"\bsee $", line[:match.start()], re.I) is not None
                is_home = in_comment and stated and not referred and not path.startswith("tests/")
                (homes if is_home else references).setdefault(match.group(1), []).append((path, number))
    return homes, references


def test_names(root):
    names = set()
    for _, text in source_files(root, ("tests",)):
        for match in TEST.finditer(text):
            suite, case = match.group(1) or match.group(3), match.group(2) or match.group(4)
            names.add(f"{suite}.{case}")
    return names


def table_rows(root):
    """[(line, tag, file, [tests])] of EQUATIONS.md; raises ValueError on a malformed row."""
    rows = []
    for number, line in enumerate(read(root, "EQUATIONS.md").splitlines(), 1):
        if not line.startswith("| `"):
            continue
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip().strip("|"))]
        if len(cells) != TABLE_COLUMNS:
            raise ValueError(f"EQUATIONS.md:{number}: {len(cells)} cells instead of {TABLE_COLUMNS}")
        tests = [test.strip(" `") for test in cells[4].split(",") if test.strip(" `")]
        rows.append((number, cells[0].strip("`"), cells[3].strip("`"), tests))
    return rows


def check_paper(root, tags, tests):
    """Findings about the table of the paper's items."""
    section = read(root, "EQUATIONS.md").partition(PAPER_HEADING)[2].partition("\n## ")[0]
    rows = re.findall(r"^\| (?!item |-)([^|]+) \| (.*) \|$", section, re.M)
    findings = []
    for item in PAPER_ITEMS:
        count = sum(name == item for name, _ in rows)
        if count != 1:
            findings.append(f"EQUATIONS.md: {item} of the paper has {count} rows")
    for name, place in rows:
        if name not in PAPER_ITEMS:
            findings.append(f"EQUATIONS.md: the paper has no {name}")
        words = re.findall(r"`([^`]+)`", place)
        if not words and not place.startswith("not here: "):
            findings.append(f"EQUATIONS.md: {name} names neither a place nor a reason")
        for word in words:
            if not (word in tags or word in tests or word.startswith(("--", "regrade "))
                    or os.path.exists(os.path.join(root, word))):
                findings.append(f"EQUATIONS.md: {name}: there is no {word}")
    return findings


def check_tree(root):
    homes, references = homes_and_references(root)
    tests = test_names(root)
    findings = []
    try:
        rows = table_rows(root)
    except (OSError, ValueError) as error:
        return [str(error)]

    for tag, places in sorted(homes.items()):
        if len(places) > 1:
            findings.append(f"EQ({tag}) has {len(places)} homes: " + ", ".join(f"{p}:{n}" for p, n in places)
                            + "; write 'see EQ(...)' in all but one")
        if tag not in {row[1] for row in rows}:
            findings.append(f"{places[0][0]}:{places[0][1]}: EQ({tag}) has no row in EQUATIONS.md")
    for tag, places in sorted(references.items()):
        if tag not in homes:
            findings.append(f"{places[0][0]}:{places[0][1]}: EQ({tag}) is not stated")

    findings += check_paper(root, homes, tests)
    seen = set()
    for number, tag, path, row_tests in rows:
        where = f"EQUATIONS.md:{number}: {tag}"
        if tag in seen:
            findings.append(f"{where} has a second row")
        seen.add(tag)
        if tag not in homes:
            findings.append(f"{where} is not stated in the sources")
        elif path != homes[tag][0][0]:
            findings.append(f"{where} lives in {homes[tag][0][0]}, not in {path}")
        if not row_tests:
            findings.append(f"{where} names no test")
        for test in row_tests:
            if test not in tests:
                findings.append(f"{where}: no test {test} in tests/")
    return findings


def main():
    arguments = parser_of(__doc__).parse_args()
    findings = check_tree(arguments.root)
    for finding in findings:
        print(finding)
    print(f"check_equations: {len(findings)} findings")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
