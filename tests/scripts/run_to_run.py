#!/usr/bin/env python3
"""Measures how much two runs of the same command differ, in fast mode and with --reproducible.

  run_to_run.py REGRADE [--runs 3]

Makes a small synthetic capture (true poses, no COLMAP), runs it several times on the CPU in each mode, with the same
number of threads and with another, and compares fields, networks and frames with the first run of the mode. Prints a
table of the number of results that differ and the largest differences of fields and decibels. Takes a minute or two.
Exit status: 0, or 1 if a reproducible run differs by a byte.
"""

import argparse
import ast
import os
import struct
import sys
import tempfile
import zipfile

from small_run import SMALL, STYLE, STYLED, call, different, make_capture, results


def arrays(path):
    """name -> values of each float array in an .npz file."""
    found = {}
    with zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            data = archive.read(name)
            start = 10 + int.from_bytes(data[8:10], "little")
            kind = ast.literal_eval(data[10:start].decode().strip())["descr"]
            letter = {"<f2": "e", "<f4": "f", "<f8": "d"}.get(kind)
            if letter:
                found[name] = struct.unpack(f"<{(len(data) - start) // struct.calcsize(letter)}{letter}", data[start:])
    return found


def largest_difference(one, other):
    """Largest difference of fields and networks, relative to the RMS of the array; inf if sizes differ."""
    largest = 0.0
    for name in ("field.npz", STYLED + "/network.npz"):
        before, after = arrays(os.path.join(one, name)), arrays(os.path.join(other, name))
        for key, values in before.items():
            if len(after[key]) != len(values):
                return float("inf")
            square = sum(value * value for value in values)
            if square > 0:
                off = max(abs(a - b) for a, b in zip(values, after[key]))
                largest = max(largest, off / (square / len(values)) ** 0.5)
    return largest


def decibels_of(found):
    """The decibel values among the results of a run."""
    return {name: value for name, value in found.items() if name.endswith("_db") and isinstance(value, float)}


def run_all(regrade, capture, scratch, runs, mode):
    """[(threads, number of different results, number of results, difference of fields, largest difference in dB)]"""
    rows, first = [], None
    options = [word for word in SMALL if word != "--reproducible"] + (["--reproducible"] if mode == "reproducible" else [])
    for index, threads in enumerate([1] + [2] * runs):
        out = os.path.join(scratch, f"{mode}{index}")
        status, message = call([regrade, "run", capture, "--style", STYLE, "--out", out, "--threads", str(threads),
                             "--device", "cpu", *options])
        if status != 0:
            sys.exit(message)
        now = results(out)
        if first is None:
            first = (out, now)
            continue
        before, after = decibels_of(first[1]), decibels_of(now)
        decibels = max((abs(before[name] - after[name]) for name in before if name in after), default=0.0)
        rows.append((threads, len(different(now, first[1])), len(now), largest_difference(first[0], out), decibels))
        if threads == 2 and index == 1:
            first = (out, now)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("regrade", help="the program")
    parser.add_argument("--runs", type=int, default=3, metavar="N", help="runs with two threads in each mode (3)")
    arguments = parser.parse_args()
    wrong = 0
    print(f"{'mode':14} {'compared':34} {'differ':>12} {'fields':>13} {'decibels':>15}")
    with tempfile.TemporaryDirectory() as scratch:
        capture = make_capture(os.path.abspath(arguments.regrade), os.path.join(scratch, "capture"))
        for mode in ("fast", "reproducible"):
            rows = run_all(os.path.abspath(arguments.regrade), capture, scratch, arguments.runs, mode)
            for index, (_, count, total, field, decibels) in enumerate(rows):
                what = "2 threads with 1 thread" if index == 0 else f"2 threads, run {index + 1} with run 1"
                print(f"{mode:14} {what:34} {count:5} of {total:4} {field:13.2g} {decibels:15.2g}", flush=True)
                wrong += mode == "reproducible" and count > 0
    print(f"run_to_run: {wrong} reproducible runs differ")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
