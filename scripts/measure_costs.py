#!/usr/bin/env python3
"""Measures what each parameter costs and changes: rows for COSTS.md.

  measure_costs.py REGRADE PHOTOS STYLE WORK [--part pose|fit|style] [--preset draft] [--only PARAMETER] [-- BASE OPTIONS]

WORK has a base run (made if it is missing) and rows.tsv; rows that exist are not measured again. Each row changes one
parameter of the base. A fit is measured on its held-out views, a style by its distance to the 2D method and by its
temporal consistency, poses by the number of registered photos and points. Seconds are wall time of the stage; CPU
seconds are of the whole command, all threads, and depend less on other load. Exit status: 0.
"""

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys

from tree_files import read

PARAMETERS = {
    "pose": [
        ("pose-image-size", ["600", "1600"]), ("pose-all-pairs-up-to", ["60"]),
    ],
    "fit": [
        ("photo-size", ["320", "720"]), ("fit-rate-density", ["2", "16"]), ("fit-rate-density-end", ["0.25", "4"]),
        ("fit-rate-sh-end", ["1e-3", "2e-2"]), ("fit-view-bound", ["0.1", "0.4"]), ("tv-decay", ["0.2", "1"]),
        ("initial-density", ["0.1", "2"]),
    ],
    "style": [
        ("style-steps", ["100", "1000"]), ("style-rays", ["1024", "16384"]), ("style-patch", ["1", "32"]),
        ("style-min-weight", ["0", "1e-2"]), ("style-view-weight", ["0", "0.3", "10"]), ("style-rate", ["2e-4", "2e-3"]), ("style-rate-last", ["7e-4"]),
        ("style-lambda", ["2e-5", "2e-3"]), ("style-base", ["mkl", "least-squares", "none"]),
        ("style-bound", ["2", "0"]), ("style-position-scale", ["0", "8"]), ("style-sh-scale", ["1", "4"]),
        ("style-norm-steps", ["1"]), ("style-activation", ["relu", "tanh"]), ("style-omega", ["2"]),
        ("style-no-k-est", [None]), ("style-no-regularisation", [None]), ("style-spectral-normalisation", [None]),
        ("style-loss", ["sum-over-voxels"]), ("method", ["reinhard"]), ("scene-wide", [None]), ("recipe", ["paper"]),
    ],
}
HEADS = {
    "pose": ["registered", "points", "reprojection px"],
    "fit": ["train dB", "held-out dB", "voxels"],
    "style": ["styled to 2D dB", "TC gap 1", "TC gap 5", "K_est", "bound", "local Lipschitz, sampled", "hue spread", "chroma"],
}


def run(command, log):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with open(log, "w") as out:
        status = subprocess.call(command, stdout=out, stderr=subprocess.STDOUT)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if status != 0:
        raise RuntimeError(f"exit status {status}, see {log}: {' '.join(command)}")
    return (after.ru_utime - before.ru_utime) + (after.ru_stime - before.ru_stime)


def stage(folder, name):
    return json.loads(read(folder, ".regrade", "stages", name + ".json"))


def metrics_of(part, folder):
    """(seconds of the stage, values in the order of HEADS)"""
    if part == "pose":
        f = stage(folder, "pose")["metrics"]
        return stage(folder, "pose")["seconds"], [f["registered"], f["points"], round(f["reprojection_px"], 3)]
    if part == "fit":
        record = stage(folder, "reconstruct")
        f = record["metrics"]
        return record["seconds"], [round(f["psnr_train_db"], 2), round(f["psnr_heldout_db"], 2), f["voxels"]]
    report = json.loads(read(folder, "styles/style/report.json"))
    s = report["stages"]["stylize"]
    near = next(f for f in report["fidelity"] if f["sequence"] == "styled")
    steady = {c["gap"]: c["tc_psnr_mean_db"] for c in report["consistency"] if c["sequence"] == "styled"}
    values = [near["psnr_to_2d_db"], steady[1], steady[5], s["k_est"], s["bound"], s["local_lipschitz_sampled"],
              near["hue_std"] / near["hue_std_2d"], near["chroma"] / near["chroma_2d"]]
    return s["seconds"], [round(v, 2) for v in values]


def measure(part, arguments, base, parameter, value):
    """A row: seconds of the stage, CPU seconds of the command, metrics."""
    row = base + ".row"
    shutil.rmtree(row, ignore_errors=True)
    option = [] if parameter is None else ["--" + parameter] + ([] if value is None else [value])
    if part == "style":
        shutil.copytree(base, row)
        # Frames at the photos' poses only: a film would cost time and adds no metric.
        command = [arguments.regrade, "stylize", row, "--style", arguments.style, "--name", "style", "--path", "views"]
    else:
        if part == "fit":
            shutil.copytree(base, row, ignore=shutil.ignore_patterns("styles", "*.mp4", "field.npz"))
        command = [arguments.regrade, "pose" if part == "pose" else "reconstruct", arguments.photos, "--out", row,
                   "--preset", arguments.preset] + arguments.base_options
        if part == "fit":
            command += ["--restart-from", "reconstruct"]
    cpu = run(command + option, base + ".log")
    seconds, values = metrics_of(part, row)
    shutil.rmtree(row)
    return seconds, cpu, values


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ["regrade", "photos", "style", "work"]:
        parser.add_argument(name)
    parser.add_argument("--part", choices=list(PARAMETERS), action="append")
    parser.add_argument("--preset", default="draft")
    parser.add_argument("--only", action="append")
    words = sys.argv[1:]
    split = words.index("--") if "--" in words else len(words)
    arguments = parser.parse_args(words[:split])
    arguments.base_options = words[split + 1:]
    base, table = os.path.join(arguments.work, "base"), os.path.join(arguments.work, "rows.tsv")
    os.makedirs(arguments.work, exist_ok=True)
    if not os.path.exists(os.path.join(base, "styles/style/report.json")):
        run([arguments.regrade, "run", arguments.photos, "--style", arguments.style, "--name", "style", "--out", base, "--preset",
             arguments.preset] + arguments.base_options, base + ".log")
    done = set()
    if os.path.exists(table):
        done = {tuple(line.split("\t")[:2]) for line in read(table).splitlines()}
    for part in arguments.part or list(PARAMETERS):
        rows = [(None, None)] + [(parameter, value) for parameter, values in PARAMETERS[part] for value in values]
        for parameter, value in rows:
            label = (part, "base" if parameter is None else f"--{parameter}" + (f" {value}" if value else ""))
            if label in done or (arguments.only and parameter not in arguments.only):
                continue
            try:
                seconds, cpu, values = measure(part, arguments, base, parameter, value)
                cells = [f"{seconds:.1f}", f"{cpu:.0f}"] + [str(v) for v in values]
            except RuntimeError as error:
                cells = [str(error)]
            with open(table, "a") as file:
                file.write("\t".join(label + tuple(cells)) + "\n")
            print("\t".join(label + tuple(cells)), flush=True)
    print_tables(table)
    return 0


def print_tables(table):
    rows = [line.split("\t") for line in read(table).splitlines()]
    for part in PARAMETERS:
        here = [row[1:] for row in rows if row[0] == part]
        if not here:
            continue
        head = ["parameter", "stage s", "CPU s"] + HEADS[part]
        print("\n| " + " | ".join(head) + " |\n|" + "---|" * len(head))
        for row in here:
            print("| " + " | ".join(row) + " |")


if __name__ == "__main__":
    sys.exit(main())
