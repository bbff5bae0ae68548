#!/usr/bin/env python3
"""Runs the commands of the Markdown files as far as their options: each must be one that the program accepts.

  documented_commands.py REGRADE

Checked are lines of code blocks and code in a sentence that begin with "regrade COMMAND". Words in capitals and files
need not exist: an input error (exit status 3) comes after the options were read, and --dry-run does no work.
Exit status: 0, or 1 if there is a finding.
"""

import functools
import os
import re
import shlex
import subprocess
import sys
import tempfile

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../..")
sys.path.insert(0, os.path.join(ROOT, "scripts"))
from tree_files import text_of, tree_files  # noqa: E402

BLOCK = re.compile(r"^(?:    )?(regrade [a-z].*)$")
INLINE = re.compile(r"`(regrade [a-z][^`]*)`")
USAGE = 2


def commands(text):
    """(line number, command) of a Markdown text."""
    fenced = False
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("```"):
            fenced = not fenced
            continue
        block = BLOCK.match(line) if fenced or line.startswith("    ") else None
        found = [block.group(1)] if block else INLINE.findall(line)
        for command in found:
            # A comment, or a description in a second column, follows.
            yield number, re.split(r"\s#|\s{2,}", command)[0].rstrip(".")


class Program:
    def __init__(self, path):
        self.path, self.options = path, {}

    def run(self, words):
        return subprocess.run([self.path, *words], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60)

    def options_of(self, command):
        if command not in self.options:
            self.options[command] = set(re.findall(r"^ +--([a-z0-9-]+)", self.run([command, "--help-all"]).stdout, re.M))
        return self.options[command]

    @functools.cache
    def problem(self, text):
        """What is wrong with a command, or nothing."""
        words = shlex.split(text.replace("|CAPTURE", "").replace(" ...", "").replace("[", "").replace("]", ""))[1:]
        command = words[0]
        known = self.options_of(command)
        if not known:
            return f"no command '{command}'"
        for word in words[1:]:
            option = word[2:].split("=")[0]
            if word.startswith("--") and not {option, option.removeprefix("no-")} & (known | {"help", "help-all", "help-constants"}):
                return f"{command} has no option --{option}"
        whole = len(words) > 1 and not {"--help", "--help-all", "--help-constants"} & set(words)
        if whole and "dry-run" in known and not text.endswith("..."):
            done = self.run([*words, "--dry-run"])
            if done.returncode == USAGE:
                return done.stderr.strip()
        return None


def main():
    program = Program(os.path.abspath(sys.argv[1]))
    checked = findings = 0
    with tempfile.TemporaryDirectory() as scratch:
        os.chdir(scratch)
        for path in tree_files(ROOT):
            if not path.endswith(".md") or path == "CHANGELOG.md":
                continue
            for number, command in commands(text_of(ROOT, path)):
                checked += 1
                problem = program.problem(command)
                if problem:
                    findings += 1
                    print(f"{path}:{number}: `{command}`: {problem}")
    print(f"documented_commands: {checked} commands, {findings} findings")
    return findings > 0 or checked == 0


if __name__ == "__main__":
    sys.exit(main())
