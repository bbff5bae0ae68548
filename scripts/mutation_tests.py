#!/usr/bin/env python3
"""Mutation tests: each safeguard is removed once and a test must fail.

An entry of tests/hard_cases/mutations.json is {case, safeguard, file, find, replace, target, tests}. `find` occurs once
in `file`: identifiers must match exactly, white space of any amount matches. With `replace` in its place the test
program `target` is built and run with the GoogleTest filter `tests`. Without a target, `tests` is a regular expression
for ctest. An entry {case, cannot_arise} gives the reason why there is nothing to remove.

  mutation_tests.py --build DIR [--only H1,F2] [--write]
                              runs the entries, in a copy of the tree; hours for all of them
  mutation_tests.py --check   builds nothing: does each entry apply, has each case an entry, is MUTATIONS.md up to date
  mutation_tests.py --rebase  for each entry that does not apply, prints the nearest lines in its file and in other files
"""

import argparse
import collections
import difflib
import filecmp
import fnmatch
import glob
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile

from tree_files import read, write

ENTRIES, TABLE = "tests/hard_cases/mutations.json", "tests/hard_cases/MUTATIONS.md"
# The cases that have an entry: the numbers that tests are named after.
CASES = "H1-H68 H70-H159 H162-H168 H170-H173 H180-H192 F1-F26 F28-F42 F44-F55 F57-F78 F90-F96"
KEYS = {"case", "safeguard", "file", "find", "replace", "target", "tests"}
HEAD = """# Mutation tests

Each safeguard of the hard cases is removed once and a test must fail. Written by `scripts/mutation_tests.py --write` from
`mutations.json`; every row has been run.

| case | safeguard removed | test that failed | how it failed |
|---|---|---|---|
"""
TEST = re.compile(r"\bTEST(?:_F|_P)?\(\s*(\w+)\s*,\s*(\w+)\s*\)")
TOKEN = re.compile(r"\w+|[^\w\s]")
FAILURE = r"^(?:\S+:\d+|unknown file): Failure\n"
TEST_SECONDS = 180  # a test that hangs has failed
CANDIDATES, LEAST_SIMILARITY = 3, 0.5  # of --rebase, for each entry
# What --rebase searches for snippets that moved: source files and the files of the build.
SEARCHED = (".h", ".cuh", ".cc", ".cu", ".py", ".sh", ".cmake", "CMakeLists.txt")


def all_cases():
    for first, last in (part.split("-") for part in CASES.split()):
        yield from (first[0] + str(number) for number in range(int(first[1:]), int(last[1:]) + 1))


def pattern_of(snippet):
    """A regular expression for a snippet: tokens exactly, white space of any amount between them.

    At the ends of the snippet white space matches within its line, or across one line break if the snippet has one.
    """
    def edge(space):
        return r"[ \t]*\n[ \t]*" if "\n" in space else r"[ \t]*" if space else ""

    body = snippet.strip()
    tokens = TOKEN.findall(body)
    if not tokens:
        return re.compile(r"(?!)")  # matches nothing
    parts = [edge(snippet[:len(snippet) - len(snippet.lstrip())]), r"\b" if re.match(r"\w", body) else ""]
    for token, following in zip(tokens, tokens[1:] + [""]):
        both_words = re.match(r"\w", token) and re.match(r"\w", following)
        parts += [re.escape(token), r"\s+" if both_words else r"\s*" if following else ""]
    parts += [r"\b" if re.search(r"\w$", body) else "", edge(snippet[len(snippet.rstrip()):])]
    return re.compile("".join(parts))


def mutated(text, entry):
    """(the text with the entry's snippet replaced, how often the snippet occurs)"""
    return pattern_of(entry["find"]).subn(lambda _: entry["replace"], text)


def occurrences(root, entry):
    path = os.path.join(root, entry["file"])
    return mutated(read(path), entry)[1] if os.path.isfile(path) else 0


def test_names(root):
    """Names as a filter matches them, without and with parameters."""
    names = []
    for path in glob.glob(os.path.join(root, "tests", "**", "*.cc"), recursive=True):
        for suite, test in TEST.findall(read(path)):
            names += [f"{suite}.{test}", f"Any/{suite}.{test}/0"]
    return names


def unknown_tests(entry, names):
    """The patterns of an entry's filter that match no test."""
    return [pattern for pattern in entry["tests"].split(":") if entry["target"] and not fnmatch.filter(names, pattern)]


def check(root):
    """(entries, complaints)"""
    try:
        entries = json.loads(read(os.path.join(root, ENTRIES)))
    except (OSError, ValueError) as error:
        return [], [str(error)]
    names, complaints = test_names(root), []
    for entry in entries:
        case = entry.get("case")
        if set(entry) == {"case", "cannot_arise"}:
            continue
        if set(entry) != KEYS or not all(isinstance(value, str) for value in entry.values()):
            complaints.append(f"{case}: an entry has {', '.join(sorted(KEYS))}; or case, cannot_arise")
            continue
        count = occurrences(root, entry)
        if count != 1:
            complaints.append(f"{case}: {entry['find'][:60]!r} occurs {count} times in {entry['file']}, not once; "
                              "see --rebase")
        if entry["find"].split() == entry["replace"].split():
            complaints.append(f"{case}: find and replace are the same")
        complaints += [f"{case}: no test is called {pattern}" for pattern in unknown_tests(entry, names)]
    have, want = {entry.get("case") for entry in entries}, list(all_cases())
    complaints += [f"{case}: no entry" for case in want if case not in have]
    complaints += [f"{case}: not one of {CASES}" for case in sorted(map(str, have - set(want)))]
    return entries, complaints


def searched_files(root):
    """Paths of the files that --rebase searches, relative to the root."""
    for folder, subfolders, names in os.walk(root):
        subfolders[:] = sorted(s for s in subfolders if not s.startswith((".", "build")))
        for name in sorted(names):
            if name.endswith(SEARCHED):
                yield os.path.relpath(os.path.join(folder, name), root).replace(os.sep, "/")


class Lines:
    """The lines of a file that are not empty, each with its number and its tokens counted."""

    def __init__(self, text):
        self.rows = [(number, line, collections.Counter(TOKEN.findall(line)))
                     for number, line in enumerate(text.splitlines(), 1) if line.strip()]

    def nearest(self, snippet):
        """(similarity from 0 to 1, line number, text) of the run of lines that is nearest to the snippet."""
        wanted, best = collections.Counter(TOKEN.findall(snippet)), (0, 0, "")
        total, height = sum(wanted.values()), max(1, len(snippet.strip().splitlines()))
        rare = set(wanted) - set("(){}[];,.:=<>&*+-")
        for size in (height, height + 1):
            for first in range(len(self.rows) - size + 1):
                rows = self.rows[first:first + size]
                if not any(word in tokens for word in rare for _, _, tokens in rows):
                    continue
                window = sum((tokens for _, _, tokens in rows), collections.Counter())
                common = sum((wanted & window).values())
                # A snippet may be a part of its lines: what is missing weighs more than what is left over.
                similarity = common / (0.8 * total + 0.2 * sum(window.values()))
                if similarity > best[0]:
                    best = (similarity, rows[0][0], "\n".join(line for _, line, _ in rows))
        return best


def candidates(entry, files):
    """[(similarity, path, line, text)] for an entry, best first; the entry's own file wins a tie."""
    found = [(*lines.nearest(entry["find"]), path) for path, lines in files.items()]
    found = [(similarity, path, line, text) for similarity, line, text, path in found if similarity >= LEAST_SIMILARITY]
    found.sort(key=lambda row: (-row[0] - 0.1 * (row[1] == entry["file"]), row[1]))
    own = [row for row in found if row[1] == entry["file"]][:1]
    return own + [row for row in found if row not in own][:CANDIDATES - len(own)]


def rebase(root, entries):
    """Lines of text: for each entry that does not apply, where its snippet may be now, and which tests are meant."""
    names, report, files = test_names(root), [], None
    for entry in entries:
        if set(entry) != KEYS:
            continue
        count = occurrences(root, entry)
        if count != 1:
            if files is None:
                texts = {path: read(os.path.join(root, path)) for path in searched_files(root)}
                files = {path: Lines(text) for path, text in texts.items()}
            report.append(f"{entry['case']}: occurs {count} times in {entry['file']}: {entry['find']!r}")
            once = [path for path, text in texts.items()
                    if path != entry["file"] and mutated(text, entry)[1] == 1]
            if count == 0 and once:
                report += [f'  moved: "file": {json.dumps(path)}' for path in once[:CANDIDATES]]
            else:
                rows = candidates(entry, files)
                report += [f"  {path}:{line} ({similarity:.0%}): {json.dumps(text, ensure_ascii=False)}"
                           for similarity, path, line, text in rows] or ["  nothing similar found"]
        for pattern in unknown_tests(entry, names):
            near = difflib.get_close_matches(pattern.strip("*"), names, CANDIDATES, 0.4)
            report.append(f"{entry['case']}: no test is called {pattern}; nearest: {', '.join(near) or 'none'}")
    return report


def run(command, seconds=None):
    """(output, exit status); the status is None after a time-out."""
    environment = dict(os.environ, OMP_WAIT_POLICY="passive", LC_ALL="C.UTF-8")
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          env=environment, start_new_session=True) as child:
        try:
            return child.communicate(timeout=seconds)[0].decode(errors="replace"), child.returncode
        except subprocess.TimeoutExpired:
            os.killpg(child.pid, signal.SIGKILL)
            return "", None


class MutationBuild:
    """A copy of the tree and its build directory. Files that are equal to the last copy keep their date."""

    def __init__(self, root, folder, jobs):
        self.tree, self.build, self.jobs = os.path.join(folder, "tree"), os.path.join(folder, "build"), jobs
        listing = run(["git", "-C", root, "ls-files", "-z", "--cached", "--others", "--exclude-standard"])[0]
        paths = {path for path in listing.split("\0") if os.path.isfile(os.path.join(root, path))}
        for old in glob.glob(os.path.join(self.tree, "**"), recursive=True):
            if os.path.isfile(old) and os.path.relpath(old, self.tree) not in paths:
                os.remove(old)
        for path in paths:
            source, target = os.path.join(root, path), os.path.join(self.tree, path)
            os.makedirs(os.path.dirname(target), exist_ok=True)
            if not os.path.isfile(target) or not filecmp.cmp(source, target, shallow=False):
                shutil.copy(source, target)
        launcher = ["-DCMAKE_CXX_COMPILER_LAUNCHER=ccache"] if shutil.which("ccache") else []
        text, status = run(["cmake", "-G", "Ninja", "-S", self.tree, "-B", self.build, "-DCMAKE_BUILD_TYPE=Release",
                            "-DCMAKE_CXX_FLAGS_RELEASE=-O1 -w", "-DREGRADE_CUDA=OFF", "-DREGRADE_BENCHMARKS=OFF",
                            *launcher])
        if status != 0:
            sys.exit(text)

    def make(self, target):
        """The first compiler error, or ''."""
        if not target:
            return ""
        text, status = run(["cmake", "--build", self.build, "--parallel", str(self.jobs), "--target", target])
        return "" if status == 0 else next((s for s in text.splitlines() if "error" in s.lower()), text[-300:])

    def test(self, target, tests):
        """([tests that failed], message of the first)"""
        program = glob.glob(os.path.join(self.build, "tests", "*", target))[0] if target else ""
        text, status = run([program, "--gtest_filter=" + tests, "--gtest_brief=1"] if target else
                           ["ctest", "--test-dir", self.build, "-R", tests, "--output-on-failure"], TEST_SECONDS)
        if status == 0:
            return [], "no test failed"
        failed = list(dict.fromkeys(re.findall(r"^\[  FAILED  \] ([\w/.]+)", text, re.M))) or [tests]
        message = (re.search(FAILURE + r"(.*?)(?=" + FAILURE + r"|^\[  FAILED)", text, re.M | re.S) or
                   re.search(r"^\S+:\d+: (?!remark)(.*)$", text, re.M))
        how = ("did not end" if status is None else message.group(1) if message else
               f"ended by signal {-status}" if status < 0 else f"exit status {status}")
        scratch = re.escape(tempfile.gettempdir())
        for pattern, word in ((re.escape(self.tree + os.sep), ""), (scratch + r"/[^\n:]*", "PATH"),
                              (str(2**64 - 1), "npos"), (r"\d+-byte object <[^>]*>", "an object")):
            how = re.sub(pattern, word, how)
        return failed, " ".join(how.split())

    def remove_safeguard(self, entry):
        """(outcome, test, message); the outcome is "failed" if a test noticed."""
        path = os.path.join(self.tree, entry["file"])
        text = read(path)
        write(path, mutated(text, entry)[0])
        try:
            complaint = self.make(entry["target"])
            failed, how = ([], complaint) if complaint else self.test(entry["target"], entry["tests"])
        finally:
            write(path, text)
        outcome = "failed" if failed else "DOES NOT COMPILE" if complaint else "SURVIVED"
        return outcome, (failed + [entry["tests"]])[0], how


def run_all(build, entries):
    """[(entry, outcome, test, message)]; file after file, so that little is built twice."""
    rows, broken = [(entry, "cannot arise", "", "") for entry in entries if "cannot_arise" in entry], {}
    entries = [entry for entry in entries if "cannot_arise" not in entry]
    for entry in sorted(entries, key=lambda e: (e["target"], e["file"])):
        target = entry["target"]
        if target not in broken:  # with all safeguards in place the named tests must pass
            filters = (":" if target else "|").join(e["tests"] for e in entries if e["target"] == target)
            complaint = build.make(target)
            broken[target] = complaint or ", ".join(build.test(target, filters)[0])
        row = (("UNSOUND", broken[target], "fails with all safeguards in place") if broken[target] else
               build.remove_safeguard(entry))
        print(f"{entry['case']:5} {row[0]:9} {row[1]}: {row[2][:100]}", flush=True)
        rows.append((entry, *row))
    return rows


def table_row(entry, *rest):
    """A row of the table; without the rest, its beginning."""
    cells = [entry["case"], entry.get("safeguard", "cannot arise: " + entry.get("cannot_arise", "")), *rest]
    return "| " + " | ".join(cell.replace("|", "\\|").replace("<", "&lt;") for cell in cells) + " |"


def write_table(root, rows):
    """Replaces the rows of these cases; other rows stay."""
    path, order = os.path.join(root, TABLE), {case: i for i, case in enumerate(all_cases())}
    new = {entry["case"] for entry, *_ in rows}
    lines = re.findall(r"^\| [HF]\d+ .*$", read(path), re.M) if os.path.isfile(path) else []
    lines = [line for line in lines if line.split()[1] in order and line.split()[1] not in new]
    for entry, outcome, test, how in rows:
        how = outcome if outcome.isupper() else how if len(how) < 130 else how[:127] + "..."
        lines.append(table_row(entry, test, how))
    lines.sort(key=lambda line: order[line.split()[1]])
    write(path, HEAD + "\n".join(lines) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter,
                                     epilog="Exit status: 0, or 1 if a safeguard was removed and no test failed, or if an\n"
                                     "entry does not apply or does not compile.")
    parser.add_argument("--root", default=os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    parser.add_argument("--only", metavar="CASE,...", help="run these cases only")
    parser.add_argument("--build", metavar="DIR", help="keep the copy of the tree and its build in DIR for the next run")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="compilers that run in parallel (1)")
    parser.add_argument("--write", action="store_true", help=f"update {TABLE}, with --only the rows of these cases")
    parser.add_argument("--check", action="store_true", help="check the entries, build nothing")
    parser.add_argument("--rebase", action="store_true", help="find the snippets of entries that do not apply")
    arguments = parser.parse_args()
    entries, complaints = check(arguments.root)
    if arguments.rebase:
        report = rebase(arguments.root, entries)
        print("\n".join(report + [f"mutation_tests: {sum(not line.startswith(' ') for line in report)} to rebase"]))
        return 1 if report else 0
    if arguments.check and not complaints:
        table = os.path.join(arguments.root, TABLE)
        table = read(table) if os.path.isfile(table) else ""
        complaints = [f"{entry['case']}: not in {TABLE}, see --write" for entry in entries
                      if table_row(entry) not in table]
    for complaint in complaints:
        print(f"{ENTRIES}: {complaint}")
    if arguments.check or complaints:
        print(f"mutation_tests: {len(entries)} entries, {len(complaints)} findings")
        return 1 if complaints else 0
    if arguments.only:
        entries = [entry for entry in entries if entry["case"] in arguments.only.split(",")]
    with tempfile.TemporaryDirectory() as scratch:
        rows = run_all(MutationBuild(arguments.root, os.path.abspath(arguments.build or scratch), arguments.jobs), entries)
    wrong = sum(outcome not in ("failed", "cannot arise") for _, outcome, _, _ in rows)
    print(f"mutation_tests: {len(rows)} entries, {wrong} without a failing test")
    if arguments.write:
        write_table(arguments.root, rows)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
