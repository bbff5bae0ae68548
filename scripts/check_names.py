#!/usr/bin/env python3
"""Checks that the files, folders and options that Markdown files and scripts name exist.

  check_names.py [--root DIR]   checks Markdown files, scripts, .ci/run and CMakePresets.json; prints FILE:LINE and the name
  check_names.py --self-test    plants names that do not exist, and checks what is found

Checked are paths that begin with a top folder of the tree (also as patterns: {a,b}, *, regular expressions), targets of
Markdown links, names of sources, scripts and Markdown files, and, in Markdown and in comments of scripts, options: a
source or script must contain "name" or "--name". Words in capitals are placeholders (tests/fuzz/TARGET). Not checked:
CHANGELOG.md, MUTATIONS.md (recorded messages), check_words.py (retired names) and functions named self_test.
Exit status: 0, or 1 if there is a finding.
"""

import argparse
import ast
import fnmatch
import io
import os
import re
import sys
import tempfile
import tokenize

from tree_files import text_of, tree_files

EXEMPT = ("CHANGELOG.md", "tests/hard_cases/MUTATIONS.md", "scripts/check_names.py", "scripts/check_words.py")
OTHER_SCRIPTS = re.compile(r"scripts/.*(\.sh|\.yaml|Snakefile)|\.ci/run|CMakePresets\.json")
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
FOREIGN = re.compile(r"https?://\S+|github\.com/\S+")
QUOTES = re.compile("^[a-zA-Z]*(\"{3}|'{3}|\"|')|(\"{3}|'{3}|\"|')$")
# A file named without its folder; one that another folder or a variable precedes is not one of ours.
NAME = re.compile(r"(?<![\w./$*{}\"'-])\w[\w-]*\.(?:py|sh|md|cc|cu|cuh|h)(?![\w/.]\w|\w)")


OPTION = re.compile(r"(?<![\w-])--([a-z][a-z0-9-]+)")
OTHER_PROGRAMS_OPTIONS = {"cores", "profile", "configfile", "retries"}  # of snakemake


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
        """Of the comments and strings outside of self-tests."""
        tree, skipped = ast.parse(text), set()
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and node.name.startswith("self_test"):
                skipped.update(range(node.lineno, node.end_lineno + 1))
        strings, prose = ([""] * (text.count("\n") + 2) for _ in range(2))
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type not in (tokenize.COMMENT, tokenize.STRING) or token.start[0] in skipped:
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


def self_test():
    tidy = {
        "kernels/base/vec.h": "", "kernels/base/view.h": "", "assets/a.png": "", "tests/hard/RESULTS.md": "",
        "CHANGELOG.md": "`kernels/old.h` went\n",
        "scripts/run.py": "\"\"\"Reads kernels/base/vec.h; see run.py.\"\"\"\nX = r\"kernels/base/(vec|view)\\.h\"\n"
                          "Y = r\"kernels/.*\\.h\", \"omp.h\"\n\n\ndef self_test():\n    return \"kernels/a.h\"  # kernels/b.h\n",
        "pipeline/a.cc": "bind(\"fit-steps\", steps);\n",
        "scripts/all.sh": "\"$root/scripts/run.py\"\nkernels=$build/kernels/x --out build/cpu/tests/x\n",
        "README.md": "`kernels/base/{vec,view}.h`, `kernels/base/`, `scripts/*.py`, [results](tests/hard/RESULTS.md#a), "
                     "https://x.org/kernels/x.h, vec.h, report.html. In kernels/base. To tests/hard/TARGET/. With --fit-steps 3, --out.\n",
    }
    planted = (
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
    failures = 0
    for path, text, expected in (("", "", ""),) + planted:
        with tempfile.TemporaryDirectory() as root:
            for name, content in {**tidy, **({path: text} if path else {})}.items():
                os.makedirs(os.path.dirname(os.path.join(root, name)) or root, exist_ok=True)
                with open(os.path.join(root, name), "w", encoding="utf-8") as file:
                    file.write(content)
            found = Tree(root).check()
        line = text[:text.find(re.split("[/ ]", expected)[-1])].count("\n") + 1
        if found != ([(path, line, expected)] if expected else []):
            failures += 1
            print(f"self-test: expected '{expected}', got {found}")
    print(f"self-test: {len(planted)} planted names, {failures} failures")
    return failures


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", default=os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    parser.add_argument("--self-test", action="store_true")
    arguments = parser.parse_args()
    if arguments.self_test:
        return 1 if self_test() else 0
    findings = Tree(arguments.root).check()
    for path, line, what in findings:
        print(f"{path}:{line}: there is no {what}")
    print(f"check_names: {len(findings)} findings")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
