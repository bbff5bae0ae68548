"""Lists and reads the files of the source tree; a module of the scripts that check it."""

import argparse
import os
import pathlib
import subprocess

HIDDEN_BUT_OURS = (".ci", ".clang-format", ".gitignore")


def parser_of(doc):
    """The parser of a script that checks the tree: its help is `doc`, and it has --root."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", default=os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    return parser


def read(*path):
    return pathlib.Path(*path).read_text(encoding="utf-8", errors="replace")


def write(path, text):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    pathlib.Path(path).write_text(text, encoding="utf-8")


def tree_files(root):
    """Sorted paths below the root, with / in them: git's files, or all but build folders where there is no git."""
    if os.path.exists(os.path.join(root, ".git")):
        done = subprocess.run(["git", "-C", root, "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        if done.returncode == 0:
            paths = set(done.stdout.decode().split("\0")) - {""}
            return sorted(path for path in paths if os.path.isfile(os.path.join(root, path)))
    found = []
    for folder, subfolders, names in os.walk(root):
        subfolders[:] = [name for name in subfolders if name in HIDDEN_BUT_OURS or not (
            name.startswith((".", "build")) or name in ("shared", "__pycache__"))]
        relative = os.path.relpath(folder, root).replace(os.sep, "/")
        found += [name if relative == "." else f"{relative}/{name}" for name in names
                  if name in HIDDEN_BUT_OURS or not name.startswith(".")]
    return sorted(found)


def text_of(root, path):
    """The text of a file; '' for binary files."""
    with open(os.path.join(root, path), "rb") as file:
        content = file.read()
    return "" if b"\0" in content else content.decode(errors="replace")
