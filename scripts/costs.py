#!/usr/bin/env python3
"""Writes the tables of COSTS.md from costs.json, where figures are kept: each replaces the line that ends with
"<!-- NAME -->" and the table below it.

  costs.py [--check]    with --check nothing is written; exit status 1 if the page is not what would be written
"""

import argparse
import json
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent


def table(name, entry):
    source = "; ".join(filter(None, (*(f"`{command}`" for command in entry.get("command", "").split("; ") if command),
                                       entry.get("commit", ""))))
    lines = [entry["note"] + (f" ({source})" if source else "") + f" <!-- {name} -->", ""]
    lines += ["| " + " | ".join(row) + " |" for row in (entry["columns"], ["---"] * len(entry["columns"]), *entry["rows"])]
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true")
    check = parser.parse_args().check
    page = ROOT / "COSTS.md"
    text = page.read_text(encoding="utf-8")
    written = text
    for name, entry in json.loads((ROOT / "costs.json").read_text(encoding="utf-8")).items():
        pattern = rf"^.*<!-- {re.escape(name)} -->\n(?:\n(?:\|.*\n)+)?"
        written, count = re.subn(pattern, lambda _: table(name, entry) + "\n", written, flags=re.M)
        if count != 1:
            sys.exit(f"COSTS.md has {count} places for {name}, not one")
    if check:
        return 0 if written == text else 1
    page.write_text(written, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
