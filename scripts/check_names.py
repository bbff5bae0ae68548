#!/usr/bin/env python3
"""Checks that the files, folders and options that Markdown files and scripts name exist.

  check_names.py [--root DIR]   checks Markdown files, scripts, .ci/run and CMakePresets.json; prints FILE:LINE and the name

Checked are paths that begin with a top folder of the tree (also as patterns: {a,b}, *, regular expressions), targets of
Markdown links, names of sources, scripts and Markdown files, and, in Markdown and in comments of scripts, options: a
source or script must contain "name" or "--name". Words in capitals are placeholders (tests/fuzz/TARGET). Not checked:
CHANGELOG.md.
Exit status: 0, or 1 if there is a finding.
"""

import fnmatch
import io
import os
import re
import sys
import tokenize

from tree_files import parser_of, text_of, tree_files

EXEMPT = ("CHANGELOG.md", "scripts/check_names.py")
OTHER_SCRIPTS = re.compile(r"scripts/.*(\.sh|\.yaml|Snakefile)|\.ci/run|CMakePresets\.json")
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
FOREIGN = re.compile(r"https?://\S+|github\.com/\S+")
QUOTES = re.compile("^[a-zA-Z]*(\"{3}|'{3}|\"|')|(\"{3}|'{3}|\"|')$")
# A file named without its folder; one that another folder or a variable precedes is not one of ours.
NAME = re.compile(r"(?<![\w./$*{}\"'-])\w[\w-]*\.(?:py|sh|md|cc|cu|cuh|h)(?![\w/.]\w|\w)")


OPTION = re.compile(r"(?<![\w-])--([a-z][a-z0-9-]+)")
OTHER_PROGRAMS_OPTIONS = {"cores", "profile", "configfile", "retries", "nolock", "rerun-incomplete"}  # of snakemake


def expanded(pattern):
    """Paths of a pattern with {a,b}."""
    match = re.search(r"\{([^{}]*)\}", pattern)
    if not match:
        return [pattern]
    return [path for part in match.group(1).split(",")
            for path in expanded(pattern[:match.start()] + part + pattern[match.end():])]


class Tree:
    def __init__(self, root):
        self.root, self.files = root, tree_files(root)
        self.folders = {"/".join(path.split("/")[:depth]) for path in self.files for depth in range(1, path.count("/") + 1)}
        self.names = {path.rsplit("/", 1)[-1] for path in self.files}
        top = sorted(folder for folder in self.folders if "/" not in folder)
        self.path = re.compile(r"(?<![\w./$}>*-])((?:" + "|".join(map(re.escape, top or ["/"])) + r")/(?:[\w./*+-]|\{[\w./,*+-]*\})*)")
        self.placeholder = re.compile(r"/[A-Z]{2,}(?=/|$).*")

        self.options = set(OTHER_PROGRAMS_OPTIONS)
        for path in self.files:
            if path.endswith((".cc", ".h", ".py")) and path not in EXEMPT:
                self.options.update(re.findall(r"\"(?:--)?([a-z][a-z0-9-]+)[\"=]", text_of(root, path)))
            elif path.endswith(".sh"):
                self.options.update(OPTION.findall(text_of(root, path)))

    def has(self, path):
        path = path.rstrip("/")
        if "*" in path:
            return any(fnmatch.fnmatchcase(known, path) for known in (*self.files, *self.folders))
        return path in self.folders or path in self.files

    def missing(self, text, names=True, options=True):
        """[(line, what)] of a text: paths, with `names` also files without their folder, and `options`."""
        found = []
        for number, line in enumerate(text.splitlines(), 1):
            line = FOREIGN.sub(" ", line).replace("$root/", "").replace("\"$root\"/", "").replace("\\.", ".")
            line = line.replace(".*", "*")
            for match in self.path.finditer(line):
                path, rest = match.group(1), line[match.end():]
                if rest[:1] in ("[", "(", "\\", "$", "<", "{"):  # a regular expression or a variable: its folder
                    path = path[:path.rfind("/")]
                path = self.placeholder.sub("", path.rstrip(".-+"))
                found += [(number, one) for one in expanded(path) if not self.has(one)]
            if names:
                found += [(number, name) for name in NAME.findall(line) if name not in self.names]
            if options:
                found += [(number, "option --" + name) for name in OPTION.findall(line) if name not in self.options]
        return found

    def missing_links(self, path, text):
        folder = os.path.dirname(path)
        return [(number, target) for number, line in enumerate(text.splitlines(), 1) for target in LINK.findall(line)
                if not re.match(r"[a-z]+:", target) and not self.has(os.path.normpath(os.path.join(folder, target)))]

    def missing_in_python(self, text):
        """Of the comments and strings."""
        strings, prose = ([""] * (text.count("\n") + 2) for _ in range(2))
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type not in (tokenize.COMMENT, tokenize.STRING):
                continue
            is_prose = token.type == tokenize.COMMENT or token.string.startswith('"""')
            words = QUOTES.sub(" ", token.string)
            for number, line in enumerate(words.splitlines(), token.start[0] - 1):
                (prose if is_prose else strings)[number] += " " + line
        return self.missing("\n".join(strings), False, False) + self.missing("\n".join(prose))

    def check(self):
        """[(path, line, what)]"""
        found = []
        for path in self.files:
            if path in EXEMPT:
                continue
            if path.endswith(".md"):
                text = text_of(self.root, path)
                findings = self.missing(LINK.sub(" ", text)) + self.missing_links(path, text)
            elif path.startswith("scripts/") and path.endswith(".py"):
                findings = self.missing_in_python(text_of(self.root, path))
            elif OTHER_SCRIPTS.fullmatch(path):
                findings = self.missing(text_of(self.root, path), options=False)
            else:
                continue
            found += [(path, *finding) for finding in sorted(set(findings))]
        return found


def main():
    arguments = parser_of(__doc__).parse_args()
    findings = Tree(arguments.root).check()
    for path, line, what in findings:
        print(f"{path}:{line}: there is no {what}")
    print(f"check_names: {len(findings)} findings")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
