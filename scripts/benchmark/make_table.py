#!/usr/bin/env python3
"""Writes the tables of a benchmark from the reports of its runs.

  make_table.py WORK [SCENE=ROLE...] [--results PAGE --commit TEXT] [--as-printed]

Reads WORK/runs/SCENE/STYLE/METHOD/SEED/styles/style/report.json and WORK/foreign/...; writes WORK/table.csv with every run, and
WORK/table.md and table.tex with means over styles and seeds, each with the standard deviation between seeds. ROLE says whether
settings were chosen on the scene. PAGE gets the tables between its lines "<!-- core -->" and "<!-- end of core -->", with the
machine, TEXT and the time that the runs took. --as-printed writes WORK/table1.md and table1.tex, too: scenes as columns, as LipRF's Table 1,
with the differences to its numbers. Exit status: 0, or 1 without a finished run or without these lines.
"""

import csv
import json
import os
import statistics
import sys

COLUMNS = ["scene", "style", "method", "seed", "motion", "flow", "heldout_db", "heldout_ssim", "short_db", "long_db", "to_2d_db", "linear_map_db",
           "hue_spread", "chroma", "structure", "distance_to_style", "k_est", "bound", "local_lipschitz_sampled", "seconds"]
SHOWN = [("short_db", "TC short", 2), ("long_db", "TC long", 2), ("to_2d_db", "to 2D", 2), ("linear_map_db", "linear map to 2D", 2),
         ("hue_spread", "hue spread", 3), ("structure", "structure", 3), ("seconds", "s", 1)]


def folders(folder):
    return sorted(os.listdir(folder)) if os.path.isdir(folder) else []


def reports(work, kind):
    """(scene, style, method, seed, report) of every finished job."""
    for scene in folders(os.path.join(work, kind)):
        for style in folders(os.path.join(work, kind, scene)):
            for method in folders(os.path.join(work, kind, scene, style)):
                for seed in folders(os.path.join(work, kind, scene, style, method)):
                    file = os.path.join(work, kind, scene, style, method, seed,
                                        "styles/style/report.json" if kind == "runs" else "report.json")
                    if seed.isdigit() and os.path.exists(file):
                        with open(file) as stream:
                            yield scene, style, method, int(seed), json.load(stream)


def rows_of(scene, style, method, seed, report):
    """A row for each sequence of frames: the renders, the 2D method on them, the restyled field, a field fitted to the 2D method's pictures."""
    foreign = "stylize" not in report["stages"]
    names = {} if foreign else {"source": "no style", "views_2d": method, "control_field_2d": method + ", field fitted",
                                "styled": method + " w/ Lip"}
    tc = {(c["sequence"], c["gap"]): c["tc_psnr_mean_db"] for c in report["consistency"]}
    gaps = sorted({gap for _, gap in tc})
    stages = report.get("stages", {})
    stylize, evaluate, fit = (stages.get(stage, {}) for stage in ("stylize", "evaluate", "reconstruct"))
    for sequence in dict.fromkeys(c["sequence"] for c in report["consistency"]):
        if sequence.startswith("path_") or (foreign and sequence == "source") or (names and sequence not in names):
            continue
        near = next((f for f in report.get("fidelity", []) if f["sequence"] == sequence), {})
        row = {"scene": scene, "style": style, "method": names.get(sequence, method), "seed": seed,
               "motion": evaluate.get("mask"), "flow": "exact" if evaluate.get("mask") == "geometry" else evaluate.get("flow"),
               "short_db": tc.get((sequence, gaps[0])), "long_db": tc.get((sequence, gaps[-1])),
               "structure": near.get("structure"), "distance_to_style": near.get("sliced_wasserstein_to_style")}
        if sequence == "source":
            row.update({"heldout_db": fit.get("psnr_heldout_db"), "heldout_ssim": fit.get("ssim_heldout")})
        if sequence in ("styled", "control_field_2d"):
            row["to_2d_db"] = near.get("psnr_to_2d_db")
        if sequence == "styled":
            row.update({"linear_map_db": evaluate.get("linear_map_psnr_to_2d_db"),
                        **{key: stylize.get(key) for key in ("k_est", "bound", "local_lipschitz_sampled", "seconds")}})
        if sequence != "source" and near.get("hue_std_2d"):
            row["hue_spread"] = near["hue_std"] / near["hue_std_2d"]
            row["chroma"] = near["chroma"] / near["chroma_2d"]
        yield row


def mean_and_spread(rows, key):
    """The mean over all rows, and the standard deviation between the means of each seed; None where there is no value."""
    of_seed = {}
    for row in rows:
        if row.get(key) is not None:
            of_seed.setdefault(row["seed"], []).append(row[key])
    if not of_seed:
        return None, None
    means = [statistics.fmean(values) for values in of_seed.values()]
    return statistics.fmean(means), statistics.stdev(means) if len(means) > 1 else None


def text(value, spread, digits):
    if value is None:
        return "--"
    return f"{value:.{digits}f}" + (f" ± {spread:.{digits}f}" if spread is not None else "")


def table(rows, roles):
    """Lines of cells: scene, role, method, motion, the metrics of SHOWN."""
    lines = []
    for scene in dict.fromkeys(row["scene"] for row in rows):
        of_scene = [row for row in rows if row["scene"] == scene]
        for method in dict.fromkeys(row["method"] for row in of_scene):
            some = [row for row in of_scene if row["method"] == method]
            lines.append([scene, roles.get(scene) or "--", method] +
                         [" / ".join(sorted({row["motion"] or "--" for row in some}))] +
                     [text(*mean_and_spread(some, key), digits) for key, _, digits in SHOWN])
    return lines


def fits(rows):
    """Lines of cells: scene, held-out PSNR and SSIM."""
    return [[scene] + [text(*mean_and_spread([r for r in rows if r["scene"] == scene], key), digits)
                       for key, digits in (("heldout_db", 2), ("heldout_ssim", 3))]
            for scene in dict.fromkeys(row["scene"] for row in rows)]


def published(scenes):
    """Lines of cells for those of the scenes that the paper has: scene, method, short, long (LipRF, its table of consistency)."""
    with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), "published.csv"), newline="") as file:
        rows = list(csv.DictReader(file))
    lines = []
    for scene in scenes:
        name = scene.removeprefix("llff_")
        for short, long in zip(rows[:len(rows) // 2], rows[len(rows) // 2:]):
            if name in short:
                lines.append([scene, short["method"], short[name] or "--", long[name] or "--"])
    return lines


def markdown(head, lines):
    return "\n".join("| " + " | ".join(cells) + " |" for cells in [head, ["---"] * len(head)] + lines) + "\n"


def as_printed(rows):
    """Head and lines of LipRF's Table 1: range, method, each scene, their mean; in brackets what is above the printed value."""
    with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), "published.csv"), newline="") as file:
        printed = {(row["pairs"], row["method"]): row for row in csv.DictReader(file)}
    scenes, lines = list(dict.fromkeys(row["scene"] for row in rows)), []
    for pairs in ("short", "long"):
        for method in dict.fromkeys(row["method"] for row in rows):
            some = [row for row in rows if row["method"] == method]
            cells, values = [], []
            for scene in scenes:
                value = mean_and_spread([row for row in some if row["scene"] == scene], pairs + "_db")[0]
                known = printed.get((pairs, method), {}).get(scene)
                cells.append(text(value, None, 1) + (f" ({value - float(known):+.1f})" if known and value is not None else ""))
                values += [value] if value is not None else []
            flows = " / ".join(sorted({row["flow"] for row in some if row.get("flow")}))
            lines.append([pairs, method, flows or "--"] + cells + [text(statistics.fmean(values) if values else None, None, 1)])
    return ["pairs", "method", "flow"] + scenes + ["mean"], lines


def latex(head, lines, words=4):
    cell = lambda value: value.replace("_", r"\_").replace("±", r"$\pm$")
    body = [" & ".join(cell(value) for value in cells) + r" \\" for cells in lines]
    return "\n".join([r"\begin{tabular}{" + "l" * words + "r" * (len(head) - words) + "}", r"\toprule", " & ".join(cell(value) for value in head) + r" \\", r"\midrule"] +
                     body + [r"\bottomrule", r"\end{tabular}", ""])


def machine():
    """"2 cores of MODEL"; without the model where the system does not say."""
    with open("/proc/cpuinfo") as file:
        models = [line.split(":", 1)[1].strip() for line in file if line.startswith("model name")]
    return f"{os.cpu_count()} cores" + (f" of {models[0]}" if models else "")


def run_seconds(work):
    """The sum over all stages of all runs, each fit once."""
    fitted, total = set(), 0.0
    for scene, _, _, seed, report in reports(work, "runs"):
        for name, stage in report["stages"].items():
            if name in ("pose", "reconstruct") and (scene, seed, name) in fitted:
                continue
            fitted.add((scene, seed, name))
            total += stage.get("seconds") or 0
    return total


def write_page(page, body):
    """Puts the text between the page's two lines."""
    begin, end = "<!-- core -->\n", "<!-- end of core -->\n"
    with open(page) as file:
        text = file.read()
    if text.count(begin) != 1 or text.count(end) != 1 or text.index(begin) > text.index(end):
        sys.exit(f"{page}: there is no line {begin.strip()} before a line {end.strip()}")
    with open(page + ".part", "w") as file:
        file.write(text[:text.index(begin)] + begin + body + text[text.index(end):])
    os.replace(page + ".part", page)


def arguments():
    """(work, {scene: role}, page or None, commit)"""
    words, given = [word for word in sys.argv[1:] if word != "--as-printed"], {}
    for flag in ("--results", "--commit"):
        if flag in words[:-1]:
            at = words.index(flag)
            given[flag] = words[at + 1]
            del words[at:at + 2]
    if not words or "--help" in words or not all("=" in word for word in words[1:]):
        print(__doc__)
        sys.exit(0 if "--help" in words else 2)
    return words[0], dict(word.split("=", 1) for word in words[1:]), given.get("--results"), given.get("--commit", "")


def main():
    work, roles, page, commit = arguments()
    rows, seen = [], set()
    for kind in ("runs", "foreign"):
        for found in reports(work, kind):
            for row in rows_of(*found):
                key = tuple(row[name] for name in ("scene", "style", "method", "seed"))
                if key not in seen:  # the renders without style are the same for every method
                    seen.add(key)
                    rows.append(row)
    if not rows:
        sys.exit(f"{work}/runs: no report.json of a finished run (did the jobs fail? see {work}/logs)")
    with open(os.path.join(work, "table.csv"), "w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    head, lines = ["scene", "settings", "method", "motion"] + [name for _, name, _ in SHOWN], table(rows, roles)
    with open(os.path.join(work, "table.md"), "w") as file:
        file.write(markdown(["scene", "held-out PSNR", "SSIM"], fits(rows)) + "\n" + markdown(head, lines))
        of_paper = published(dict.fromkeys(row["scene"] for row in rows))
        if of_paper:
            file.write("\nAs published for LipRF: means of four styles, in dB, at as many views as it trained on. Other fits, styles and flow "
                       "(RAFT) than above: the order of the methods compares, decibels do not. Orchids' CCPL w/ Lip, short, is printed "
                       "as 262.\n\n" +
                       markdown(["scene", "method", "TC short", "TC long"], of_paper))
    with open(os.path.join(work, "table.tex"), "w") as file:
        file.write(latex(head, lines))
    if "--as-printed" in sys.argv:
        printed = as_printed(rows)
        with open(os.path.join(work, "table1.md"), "w") as file:
            file.write(markdown(*printed))
        with open(os.path.join(work, "table1.tex"), "w") as file:
            file.write(latex(*printed, words=3))
    if page:
        runs = len({(row["scene"], row["style"], row["method"].split(" w/ ")[0].split(",")[0], row["seed"])
                    for row in rows if row["method"] != "no style"})
        write_page(page, f"{runs} runs, {run_seconds(work) / 60:.0f} minutes of fits and styles; {machine()}; {commit}.\n\n" +
                   markdown(["scene", "held-out PSNR", "SSIM"], fits(rows)) + "\n" + markdown(head, lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
