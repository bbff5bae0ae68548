#!/usr/bin/env python3
"""Where the benchmark's captures and styles come from, and whether those of a folder are the same.

  sources.py DATA            compares DATA's folders with the checksums of SOURCES.md; exit status 1 where one differs
  sources.py DATA --write    writes SOURCES.md from sources.json and DATA

A checksum is the SHA-256 of the lines "SHA-256 of the file, two spaces, path in the folder" of all files, in the order of paths:
what `find . -type f -printf '%P\\n' | LC_ALL=C sort | xargs -d '\\n' sha256sum | sha256sum` prints in the folder.
"""

import hashlib
import json
import os
import re
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
PAGE = os.path.join(HERE, "SOURCES.md")
HEAD = """# Captures and styles of the benchmark

Every eighth photo, in the order of names from the first, is held out of the fit, of every capture. `sources.py DATA` compares a folder with
the checksums, and says how they are made. The synthetic scenes are written by `regrade synth` and need no source; the styles `sunset`, `night` and `autumn`
are the project's own (`assets/`). Pictures of captures without a stated licence are measured with and not published.

| name | folder of DATA | source | licence | files | SHA-256 |
| --- | --- | --- | --- | --- | --- |
"""


def checksum(folder):
    """(number of files, checksum) of all files below a folder."""
    files = sorted(os.path.relpath(os.path.join(place, name), folder) for place, _, names in os.walk(folder) for name in names)
    lines = hashlib.sha256()
    for name in files:
        with open(os.path.join(folder, name), "rb") as file:
            lines.update(f"{hashlib.file_digest(file, 'sha256').hexdigest()}  {name}\n".encode())
    return len(files), lines.hexdigest()


def main():
    if len(sys.argv) < 2 or sys.argv[1] == "--help" or sys.argv[2:] not in ([], ["--write"]):
        print(__doc__)
        return 0 if "--help" in sys.argv else 2
    data = sys.argv[1]
    with open(os.path.join(HERE, "sources.json")) as file:
        sources = json.load(file)
    if sys.argv[2:] == ["--write"]:
        rows = []
        for s in sources:
            files, digest = checksum(os.path.join(data, s["path"]))
            rows.append(f"| {s['name']} | `{s['path']}` | {s['source']} | {s['licence']} | {files} | `{digest}` |\n")
        with open(PAGE, "w") as file:
            file.write(HEAD + "".join(rows))
        return 0
    with open(PAGE) as file:
        known = dict(re.findall(r"^\| [^|]* \| `([^`]+)` \|.*`([0-9a-f]{64})` \|$", file.read(), re.M))
    status = 0
    for s in sources:
        folder = os.path.join(data, s["path"])
        if not os.path.isdir(folder):
            print(f"{s['name']}: {folder} is not there")
        elif checksum(folder)[1] != known.get(s["path"]):
            print(f"{s['name']}: {folder} is not what was measured")
            status = 1
    return status


if __name__ == "__main__":
    sys.exit(main())
