#!/usr/bin/env python3
"""Compares 2D methods on finished reconstructions, and prints a Markdown table.

  compare_methods.py REGRADE --styles A.jpg B.jpg [--methods mkl gmm ...] [--steps N] DIR...

DIR are folders of `regrade reconstruct`. For each of them, each style and each method `regrade stylize` makes the style
compare-METHOD-STYLE there; one that is finished is not made again. A method ending in "+wide" runs with --scene-wide, one
ending in "+regrain" with --style-regrain. The rows are means over folders and styles, the worst in brackets where it says
more: the distance of the 2D frames' colours to the style's (sliced Wasserstein), how far edges keep their places
(structure), the temporal consistency of the 2D frames, and of the scene that learned them fidelity, consistency and
largest local Lipschitz constant; seconds of the stage style_2d. --steps shortens the training: the columns of the scene
are then those of a draft. --no-scene leaves these columns out.
"""

import argparse
import json
import os
import subprocess
import sys

COLUMNS = (("distance", "distance to the style", 4, max), ("structure", "structure", 3, min),
           ("tc_2d", "TC of 2D frames, dB", 2, min), ("seconds", "2D, s", 1, max),
           ("psnr", "scene to 2D, dB", 2, min), ("tc_scene", "TC of the scene, dB", 2, min), ("k", "scene's K", 2, max))
FLAGS = {"wide": "--scene-wide", "regrain": "--style-regrain"}


def name_of(method, style):
    stem = os.path.splitext(os.path.basename(style))[0]
    return "compare-" + method.replace("+", "-") + "-" + "".join(c if c.isalnum() else "_" for c in stem)


def report_of(regrade, folder, style, method, steps):
    """The report of that style, made if it is not there."""
    name = name_of(method, style)
    report = os.path.join(folder, "styles", name, "report.json")
    if not os.path.exists(report):
        words = method.split("+")
        command = [regrade, "stylize", folder, "--style", style, "--name", name, "--method", words[0], "--page", "off",
                   "--film-seconds", "1", "--fps", "12", "--film-size", "160"] + [FLAGS[word] for word in words[1:]]
        if steps:
            command += ["--style-steps", str(steps)]
        run = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        if run.returncode != 0:
            sys.exit(f"{' '.join(command)}\n{run.stdout}")
    with open(report, encoding="utf-8") as file:
        return json.load(file)


def rows(report, key, **wanted):
    return [row for row in report[key] if all(row[name] == value for name, value in wanted.items())]


def numbers(report):
    """One number for each column; None where it was not measured."""
    fidelity = {row["sequence"]: row for row in report["fidelity"]}
    gap = min(row["gap"] for row in report["consistency"])
    consistency = {row["sequence"]: row for row in rows(report, "consistency", gap=gap)}
    return {"distance": fidelity["views_2d"]["sliced_wasserstein_to_style"],
            "structure": fidelity["views_2d"]["structure"],
            "tc_2d": consistency["views_2d"]["tc_psnr_mean_db"],
            "seconds": next(stage["seconds"] for stage in report["stages"] if stage["name"] == "style_2d"),
            "psnr": fidelity["styled"]["psnr_to_2d_db"],
            "tc_scene": consistency["styled"]["tc_psnr_mean_db"],
            "k": report["stylize"]["local_lipschitz_max"]}


def cell(values, digits, worst):
    known = [value for value in values if value is not None]
    if not known:
        return "-"
    mean = sum(known) / len(known)
    return f"{mean:.{digits}f} ({worst(known):.{digits}f})"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("regrade")
    parser.add_argument("folders", nargs="+", metavar="DIR")
    parser.add_argument("--styles", nargs="+", required=True)
    parser.add_argument("--methods", nargs="+", default=["mkl", "mkl+wide", "gmm", "gmm+wide", "reinhard", "idt", "histogram"])
    parser.add_argument("--steps", type=int, default=0)
    parser.add_argument("--no-scene", action="store_true")
    arguments = parser.parse_args()
    columns = COLUMNS[:4] if arguments.no_scene else COLUMNS
    print("| method | " + " | ".join(title for _, title, _, _ in columns) + " |")
    print("|---|" + "---|" * len(columns))
    for method in arguments.methods:
        measured = [numbers(report_of(arguments.regrade, folder, style, method, arguments.steps))
                    for folder in arguments.folders for style in arguments.styles]
        cells = [cell([row[key] for row in measured], digits, worst) for key, _, digits, worst in columns]
        print(f"| `{method}` | " + " | ".join(cells) + " |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
