#!/usr/bin/env python3
"""Restyles a finished output folder with parts of LipRF removed one at a time, and tabulates the effect of each.

  ablation.py REGRADE DIR --work FOLDER [--readings] [--style PICTURE] [--steps N] [--recipes paper,standard]
              [--only NAME ...] [-- OPTIONS OF stylize]

DIR is not changed: the reconstruction is copied to FOLDER/NAME for each variant, and `regrade stylize` runs there; a
finished variant is skipped. A --config among the OPTIONS is joined with a variant's. Prints a table in Markdown and
writes FOLDER/ablation.md, FOLDER/ablation.json (the metrics) and FOLDER/bound.svg (the Lipschitz bound over the steps,
on a logarithmic scale). Exit status: 0, or 1 if a run failed.

The variants follow LipRF's Sec. 6.3: the activation, without K_est, without regularisation, with spectral normalisation
to 1, each for every recipe. With --readings they are interpretations of the paper's text instead: what its B counts,
steps, rates, starts and seeds.
"""

import argparse
import json
import math
import os
import shutil
import subprocess
import sys

from tree_files import read, write

# Name, options that go by --config, and flags.
VARIANTS = (
    ("as it is", {}),
    ("relu", {"style-activation": "relu"}),
    ("leaky-relu", {"style-activation": "leaky-relu"}),
    ("sigmoid", {"style-activation": "sigmoid"}),
    ("tanh", {"style-activation": "tanh"}),
    ("without K_est", {"style-no-k-est": True}),
    ("without regularisation", {"style-no-regularisation": True}),
    ("spectral normalisation", {"style-spectral-normalisation": True}),
)
# Interpretations of the paper's text, and choices that it does not specify.
READINGS = (
    ("as it is", {}),
    ("mean over rays", {"style-loss": "mean"}),
    ("norms settle", {"style-settle-norms": True}),
    ("no hidden biases", {"style-hidden-bias": False}),
    ("views in passes", {"style-view-order": "passes"}),
    ("300 passes", {"style-view-order": "passes"}, "--style-steps", "300 VIEWS"),
    ("1000 steps", {}, "--style-steps", "1000"),
    ("rate 3e-3, 1000 steps", {"style-rate": 0.003, "style-rate-last": 3e-05}, "--style-steps", "1000"),
    ("starts as SIREN", {"style-start": "siren"}),
    ("starts as SIREN, wide last layer", {"style-start": "siren-wide-end"}),
    ("starts as SIREN, layers alike", {"style-start": "siren-even"}),
    ("starts orthogonal", {"style-start": "orthogonal"}),
    ("starts at the identity", {"style-start": "identity"}),
    ("another seed", {}, "--seed", "1"),
    ("a third seed", {}, "--seed", "2"),
    ("starts at the colour map", {"style-base": "best"}),
)
KEPT = ("poses", "field.npz", "run.json", ".regrade")
STAGES_KEPT = ("pose.json", "reconstruct.json")
COLOURS = ("#1b6ca8", "#c8553d", "#588157", "#8d6a9f", "#b08900", "#2a9d8f", "#7f5539", "#444444")


def copy_reconstruction(source, target):
    """Copies poses and field with their records, from which every variant starts."""
    os.makedirs(target)
    for name in KEPT:
        path = os.path.join(source, name)
        if os.path.isdir(path):
            shutil.copytree(path, os.path.join(target, name), ignore=shutil.ignore_patterns("lock", "checkpoints"))
        else:
            shutil.copy2(path, target)
    stages = os.path.join(target, ".regrade", "stages")
    for name in os.listdir(stages):
        if name not in STAGES_KEPT:
            os.remove(os.path.join(stages, name))


def without_configs(words):
    """(the options that --config names, as JSON or as a file of it, and the other words)"""
    given, others, words = {}, [], iter(words)
    for word in words:
        if not word.startswith("--config"):
            others.append(word)
            continue
        value = word.partition("=")[2] or next(words, "{}")
        given.update(json.loads(value if value.lstrip().startswith("{") else read(value)))
    return given, others


def metrics_of(folder):
    report = json.loads(read(folder, "styles/style/report.json"))
    stylize, evaluate = report["stages"]["stylize"], report["stages"]["evaluate"]
    steady = {row["gap"]: row["tc_psnr_mean_db"] for row in report["consistency"] if row["sequence"] == "styled"}
    faith = next(row for row in report["fidelity"] if row["sequence"] == "styled")
    return {
        "psnr_to_2d_db": faith["psnr_to_2d_db"],
        "psnr_to_2d_photos_db": evaluate.get("psnr_to_2d_photos_db"),
        "linear_map_psnr_to_2d_db": evaluate.get("linear_map_psnr_to_2d_db"),
        "tc": [steady[gap] for gap in sorted(steady)],
        "gaps": sorted(steady),
        "bound": stylize["bound"],
        "balance": stylize.get("loss_balance"),
        "k_est": stylize["k_est"],
        "local_lipschitz_sampled": stylize["local_lipschitz_sampled"],
        "local_lipschitz_max": stylize.get("local_lipschitz_max"),
        "hue_std": faith["hue_std"],
        "hue_std_2d": faith["hue_std_2d"],
        "chroma": faith["chroma"],
        "chroma_2d": faith["chroma_2d"],
        "bound_at_steps": stylize.get("bound_at_steps", []),
        "seconds": stylize["seconds"],
    }


def number(value, digits=2):
    return "–" if value is None else f"{value:.{digits}f}"


def ratio(value, whole):
    return "–" if value is None or not whole else f"{value / whole:.2f}"


def table(rows):
    gaps = rows[0][2]["gaps"]
    head = ["recipe", "variant", "styled to 2D, dB", "to 2D of the photos, dB"] + [f"TC-PSNR gap {gap}, dB" for gap in gaps]
    head += ["3 Q / B", "bound at the start", "bound", "local Lipschitz, sampled", "maximum by gradient ascent", "K_est", "hue spread kept", "chroma kept", "s"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for recipe, variant, f in rows:
        cells = [recipe, variant, number(f["psnr_to_2d_db"]), number(f["psnr_to_2d_photos_db"])] + [number(tc) for tc in f["tc"]]
        start = f["bound_at_steps"][0][1] if f["bound_at_steps"] else None
        cells += [number(f["balance"], 3), number(start), number(f["bound"]), number(f["local_lipschitz_sampled"]), number(f["local_lipschitz_max"]), number(f["k_est"])]
        cells += [ratio(f["hue_std"], f["hue_std_2d"]), ratio(f["chroma"], f["chroma_2d"]), number(f["seconds"], 0)]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def curves(rows):
    """The bound over the steps, as SVG text."""
    width, height, left, right, top, bottom = 860, 420, 60, 240, 16, 36
    lines = [(f"{recipe}, {variant}", f["bound_at_steps"]) for recipe, variant, f in rows]
    points = [p for _, line in lines for p in line if p[1] > 0]
    if not points:
        return None
    low, high = min(p[1] for p in points) / 1.1, max(p[1] for p in points) * 1.1
    last = max(max(p[0] for p in points), 1)

    def x(step):
        return left + step / last * (width - left - right)

    def y(value):
        return height - bottom - math.log(value / low) / math.log(high / low) * (height - top - bottom)

    svg = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" '
           'font-size="12"><rect width="100%" height="100%" fill="white"/>']
    base = 10 if high / low > 64 else 2
    value = base ** math.ceil(math.log(low, base))
    while value < high:
        svg.append(f'<line x1="{left}" x2="{width - right}" y1="{y(value):.1f}" y2="{y(value):.1f}" stroke="#ddd"/>'
                   f'<text x="{left - 6}" y="{y(value) + 4:.1f}" text-anchor="end">{value:g}</text>')
        value *= base
    svg.append(f'<text x="{left}" y="{height - 12}">step 0</text>'
               f'<text x="{width - right}" y="{height - 12}" text-anchor="end">{last}</text>')
    for k, (name, line) in enumerate(lines):
        colour = COLOURS[k % len(COLOURS)]
        dash = "" if k < len(COLOURS) else ' stroke-dasharray="5 3"'
        path = " ".join(f"{x(step):.1f},{y(bound):.1f}" for step, bound in line if bound > 0)
        svg.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.6"{dash}/>'
                   f'<line x1="{width - right + 12}" x2="{width - right + 32}" y1="{26 + 18 * k}" y2="{26 + 18 * k}" '
                   f'stroke="{colour}" stroke-width="2"{dash}/>'
                   f'<text x="{width - right + 38}" y="{30 + 18 * k}">{name}</text>')
    return "".join(svg) + "</svg>\n"


def save(work, rows):
    """Writes the results so far, so that an interrupted run loses only the rest."""
    write(os.path.join(work, "ablation.json"),
          json.dumps([{"recipe": r, "variant": v, **f} for r, v, f in rows], indent=1))
    write(os.path.join(work, "ablation.md"), table(rows) + "\n")
    if drawing := curves(rows):
        write(os.path.join(work, "bound.svg"), drawing)


def main():
    words = sys.argv[1:]
    split = words.index("--") if "--" in words else len(words)
    own, extra = words[:split], words[split + 1:]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("regrade")
    parser.add_argument("folder")
    parser.add_argument("--work", required=True, help="folder for the variants")
    parser.add_argument("--style", help="style picture; default: the one of DIR")
    parser.add_argument("--steps", type=int, help="training steps; default: those of the recipe")
    parser.add_argument("--recipes", default="paper", help="paper, standard, or both separated by a comma")
    parser.add_argument("--readings", action="store_true", help="interpretations of the paper's text as variants")
    parser.add_argument("--only", action="append", help="name of a variant; may be given more than once")
    options = parser.parse_args(own)
    for name in KEPT:
        if not os.path.exists(os.path.join(options.folder, name)):
            parser.error(f"{options.folder} has no {name}: make it with `regrade run`")
    variants = READINGS if options.readings else VARIANTS
    names = [name for name, *_ in variants]
    wanted = options.only or names
    for name in wanted:
        if name not in names:
            parser.error(f"there is no variant '{name}'; there are: " + ", ".join(names))
    given, extra = without_configs(extra)
    registered = json.loads(read(options.folder, ".regrade/stages/pose.json"))["metrics"]["registered"]
    rows = []
    for recipe in options.recipes.split(","):
        for name, config, *flags in variants:
            if name not in wanted:
                continue
            folder = os.path.join(options.work, f"{recipe} {name}".replace(" ", "_").replace(",", ""))
            if not os.path.exists(folder):
                copy_reconstruction(options.folder, folder)
            command = [options.regrade, "stylize", folder, "--recipe", recipe, "--name", "style", "--path", "views", *extra]
            if options.style:
                command += ["--style", options.style]
            if options.steps:
                command += ["--style-steps", str(options.steps)]
            command += ["--config", json.dumps({**given, **config})]
            # "300 VIEWS": as many times the number of registered photos.
            command += [str(int(word.split()[0]) * registered) if word.endswith(" VIEWS") else word for word in flags]
            print(f"{recipe}, {name} ...", file=sys.stderr, flush=True)
            log = os.path.join(options.work, os.path.basename(folder) + ".log")
            with open(log, "w", encoding="utf-8") as file:
                status = subprocess.run(command, stdout=file, stderr=subprocess.STDOUT, check=False).returncode
            if status != 0:
                print(f"{recipe}, {name}: regrade ended with {status}, see {log}", file=sys.stderr)
                return 1
            rows.append((recipe, name, metrics_of(folder)))
            save(options.work, rows)
    print(table(rows))
    if curves(rows):
        print(f"\nthe bound over the steps: {os.path.join(options.work, 'bound.svg')}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
