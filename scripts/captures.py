#!/usr/bin/env python3
"""Reconstructs every capture with the automatic choice of effects, and tabulates what was chosen.

  captures.py REGRADE DATA --work FOLDER [--gains] [--only NAME,...] [-- OPTIONS OF reconstruct]

DATA is a folder of real captures (missing ones are skipped); synthetic ones, one for each effect, are made in FOLDER.
With --gains each chosen effect is switched off once (`--effects NAME=off`, with the same poses unless the effect changes
them), and the table shows its gain in held-out PSNR and its cost in CPU seconds of the fit. OPTIONS default to
`--preset draft`. Finished runs are skipped. Prints a table in Markdown; FOLDER/captures.json has the metrics,
FOLDER/NAME.log the output of the program. Exit status: 0, or 1 if a capture ended with an unexpected exit status.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys

from tree_files import read, write

# name, path in DATA, expected exit status
REAL = (("kermit", "kermit", 0), ("sceaux_castle", "sceaux_castle", 0),
        ("fountain-P11", "strecha/fountain-P11/images", 0),
        ("Herz-Jesus-P8", "strecha/Herz-Jesus-P8/images", 0), ("fox", "fox/images", 0),
        ("fox_given", "fox", 0), ("llff_fern", "llff_fern", 0),
        ("lego", "lego", 0), ("pure_rotation", "hard/pure_rotation", 6), ("three_photos", "hard/three_photos", 6),
        ("no_rigid_scene", "hard/no_rigid_scene", 6))
# name, options of synth, folder of the capture in its output
SMALL = ("--size", "320x240")
SYNTHETIC = (("matte", ("--scene", "table"), "images"),
             ("highlights", ("--scene", "table", "--effects", "highlights"), "images"),
             ("wall", ("--scene", "wall"), "images"), ("square", ("--scene", "square", "--views", "40"), "images"),
             ("exposure", ("--scene", "table", "--effects", "exposure"), "images"),
             # With true poses in a transforms.json, without points.
             ("exposure_given", ("--scene", "table", "--effects", "exposure"), "truth"),
             ("wall_given", ("--scene", "wall"), "truth"),
             ("barrel", ("--scene", "table", "--effects", "barrel"), "images"),
             ("poses", ("--scene", "table", "--effects", "poses"), ""))
NO_SWITCH = ("distortion",)  # cannot be switched off


def call(command, log):
    with open(log, "a", encoding="utf-8") as file:
        file.write(" ".join(command) + "\n")
        file.flush()
        return subprocess.run(command, stdin=subprocess.DEVNULL, stdout=file, stderr=file, check=False).returncode


def record_of(folder, stage):
    path = os.path.join(folder, ".regrade", "stages", stage + ".json")
    return json.loads(read(path)) if os.path.exists(path) else {}


def last_message(log):
    lines = [line.strip() for line in read(log).splitlines() if line.strip()]
    message = next((line for line in reversed(lines) if "error" in line.lower()), lines[-1] if lines else "")
    return message.removeprefix("regrade: ").split(" To do: ")[0]


def metrics_of(folder):
    pose, fit = record_of(folder, "pose"), record_of(folder, "reconstruct")
    metrics = {"cpu_seconds": {"pose": pose.get("cpu_seconds"), "reconstruct": fit.get("cpu_seconds")}}
    for key in ("psnr_heldout_db", "psnr_train_db", "voxels", "sh_degree"):
        metrics[key] = fit.get("metrics", {}).get(key)
    index = os.path.join(folder, "poses", "photos.json")
    if os.path.exists(index):
        metrics["photos"] = len(json.loads(read(index))["photos"])
    metrics["registered"] = pose.get("metrics", {}).get("registered")
    metrics["effects"] = pose.get("metrics", {}).get("effects", []) + fit.get("metrics", {}).get("effects", [])
    return metrics


def copy_poses(source, target):
    """Copies the finished stage pose from one folder to another."""
    stages = os.path.join(".regrade", "stages")
    if os.path.exists(os.path.join(target, stages, "pose.json")):
        return
    os.makedirs(os.path.join(target, stages), exist_ok=True)
    shutil.copytree(os.path.join(source, "poses"), os.path.join(target, "poses"), dirs_exist_ok=True)
    shutil.copy2(os.path.join(source, stages, "pose.json"), os.path.join(target, stages))


def measure(arguments, name, source, status):
    """The metrics of one capture, and those without each chosen effect."""
    log, out = os.path.join(arguments.work, name + ".log"), os.path.join(arguments.work, name)
    ended = call([arguments.regrade, "reconstruct", source, "--out", out] + arguments.options, log)
    metrics = {"name": name, "status": ended, "as_expected": ended == status, "message": last_message(log)}
    metrics.update(metrics_of(out))
    if ended != 0 or not arguments.gains:
        return metrics
    decided = {effect["name"]: "on" if effect["on"] else "off" for effect in metrics["effects"]}
    for effect in metrics["effects"]:
        if not effect["on"] or effect["name"] in NO_SWITCH:
            continue
        without = out + ".without." + effect["name"]
        # View dependence as the trial decided it, so that the two runs differ in one effect only.
        overrides = {"view-dependence": decided.get("view-dependence", "on"), effect["name"]: "off"}
        if effect["name"] != "pose-refinement":
            copy_poses(out, without)
        overrides = ",".join(f"{key}={value}" for key, value in overrides.items())
        again = call([arguments.regrade, "reconstruct", source, "--out", without, "--effects", overrides]
                     + arguments.options, log)
        effect["without"] = metrics_of(without) if again == 0 else {"why": last_message(log)}
    return metrics


def number(value, form="{:.2f}"):
    return "–" if value is None else form.format(value)


def chosen(effect, metrics):
    value, threshold = effect.get("value"), effect.get("threshold")
    text = effect["name"]
    if value is not None and threshold is not None:
        text += f" ({value:.3g} {'>' if value > threshold else '<='} {threshold:.3g})"
    else:
        text += f" ({effect['evidence']})"
    without = effect.get("without", {})
    if without.get("psnr_heldout_db") is not None:
        stage = "pose" if effect["name"] == "pose-refinement" else "reconstruct"
        text += f": {metrics['psnr_heldout_db'] - without['psnr_heldout_db']:+.2f} dB"
        if metrics["cpu_seconds"][stage] is not None and without["cpu_seconds"][stage] is not None:
            text += f", {metrics['cpu_seconds'][stage] - without['cpu_seconds'][stage]:+.0f} s"
    elif "why" in without:
        text += ": fails without it"
    return text


def table_of(rows):
    lines = ["| capture | photos registered | chosen (measured, threshold): gain and cost | held-out PSNR "
             "| CPU s |", "|---|---|---|---|---|"]
    for row in rows:
        seconds = row["cpu_seconds"]["reconstruct"]
        if row["status"] != 0:
            lines.append(f"| {row['name']} | | refused, exit status {row['status']}: {row['message']} | | |")
            continue
        on = "; ".join(chosen(effect, row) for effect in row["effects"] if effect["on"]) or "nothing"
        lines.append(f"| {row['name']} | {row['registered']}/{row['photos']} | {on} | "
                     f"{number(row['psnr_heldout_db'])} dB | {number(seconds, '{:.0f}')} |")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("regrade")
    parser.add_argument("data")
    parser.add_argument("--work", required=True)
    parser.add_argument("--gains", action="store_true")
    parser.add_argument("--only", default="")
    split = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
    arguments = parser.parse_args(sys.argv[1:split])
    arguments.options = sys.argv[split + 1:] or ["--preset", "draft"]
    only = [name for name in arguments.only.split(",") if name]
    os.makedirs(arguments.work, exist_ok=True)
    captures = [(name, os.path.join(arguments.data, path), status) for name, path, status in REAL]
    for name, options, part in SYNTHETIC:
        if only and name not in only:
            continue
        folder = os.path.join(arguments.work, "synthetic", name)
        log = os.path.join(arguments.work, name + ".log")
        if call([arguments.regrade, "synth", folder, *SMALL, *options], log) != 0:
            sys.exit(f"captures.py: the synthetic capture {name} failed, see {log}")
        captures.append(("synthetic: " + name, os.path.join(folder, part), 0))
    rows = []
    for name, source, status in captures:
        if (only and name.split(": ")[-1] not in only) or not os.path.isdir(source):
            continue
        rows.append(measure(arguments, name.split(": ")[-1], source, status) | {"name": name})
        write(os.path.join(arguments.work, "captures.json"), json.dumps(rows, indent=1))
        print(name, "done", file=sys.stderr, flush=True)
    print(table_of(rows))
    return 0 if all(row["as_expected"] for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
