#!/usr/bin/env python3
"""Writes the tables of a sweep from the reports of its runs.

  make_table.py WORK

Reads WORK/runs/SCENE/STYLE/METHOD/styles/style/report.json and WORK/foreign/...; writes table.csv with all metrics, and table.tex and
table.html with means over the styles in the form of the paper's table. Exit status: 0, or 1 without a finished run.
"""

import csv
import html
import json
import os
import sys

COLUMNS = ["scene", "style", "method", "short_db", "long_db", "to_2d_db", "linear_map_db", "hue_spread", "chroma",
           "distance_to_style", "k_est", "bound", "local_lipschitz_sampled", "seconds"]
# Scene fern in LipRF's paper (table of short and long consistency on LLFF): short, long.
PAPER = [("MKL", 28.4, 25.6), ("WCT2", 24.0, 22.1), ("WCT2 w/ Lip", 29.5, 26.7), ("CCPL", 22.0, 20.5),
         ("CCPL w/ Lip", 26.7, 24.1), ("UPST", 27.6, 24.8)]


def reports(work, kind):
    """(scene, style, method, report) of every finished job."""
    for scene in sorted(os.listdir(os.path.join(work, kind)) if os.path.isdir(os.path.join(work, kind)) else []):
        for style in sorted(os.listdir(os.path.join(work, kind, scene))):
            folder = os.path.join(work, kind, scene, style)
            for method in sorted(os.listdir(folder)):
                file = os.path.join(folder, method, "styles/style/report.json" if kind == "runs" else "report.json")
                if not method.endswith(".part") and os.path.exists(file):
                    with open(file) as stream:
                        yield scene, style, method, json.load(stream)


def rows_of(scene, style, method, report):
    """A row for each sequence of frames: the renders, the 2D method on them, the restyled field."""
    names = {"source": "no style", "views_2d": method, "styled": method + " w/ Lip"}
    tc = {(c["sequence"], c["gap"]): c["tc_psnr_mean_db"] for c in report["consistency"]}
    gaps = sorted({gap for _, gap in tc})
    stylize = report.get("stages", {}).get("stylize", {})
    evaluate = report.get("stages", {}).get("evaluate", {})
    for sequence in dict.fromkeys(c["sequence"] for c in report["consistency"]):
        if sequence.startswith("path_"):
            continue
        near = next((f for f in report.get("fidelity", []) if f["sequence"] == sequence), {})
        row = {"scene": scene, "style": style, "method": names.get(sequence, method),
               "short_db": tc.get((sequence, gaps[0])), "long_db": tc.get((sequence, gaps[-1])),
               "distance_to_style": near.get("sliced_wasserstein_to_style")}
        if sequence == "styled":
            row.update({"to_2d_db": near.get("psnr_to_2d_db"), "linear_map_db": evaluate.get("linear_map_psnr_to_2d_db"),
                        "k_est": stylize.get("k_est"), "bound": stylize.get("bound"),
                        "local_lipschitz_sampled": stylize.get("local_lipschitz_sampled"), "seconds": stylize.get("seconds")})
        if near.get("hue_std_2d"):
            row["hue_spread"] = near["hue_std"] / near["hue_std_2d"]
            row["chroma"] = near["chroma"] / near["chroma_2d"]
        yield row


def mean(values):
    values = [v for v in values if v is not None]
    return sum(values) / len(values) if values else None


def text(value, digits=1):
    return "--" if value is None else value if isinstance(value, str) else f"{value:.{digits}f}"


def summary(rows):
    """method -> scene or "mean" -> (short, long, to 2D), means over styles."""
    methods = list(dict.fromkeys(row["method"] for row in rows))
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    table = {}
    for method in methods:
        for scene in scenes + ["mean"]:
            some = [r for r in rows if r["method"] == method and scene in (r["scene"], "mean")]
            table.setdefault(method, {})[scene] = tuple(
                mean([r.get(key) for r in some]) for key in ("short_db", "long_db", "to_2d_db"))
    return scenes, table


def latex(scenes, table):
    lines = [r"\begin{tabular}{l" + "rr" * (len(scenes) + 1) + "}", r"\toprule",
             "method & " + " & ".join(rf"\multicolumn{{2}}{{c}}{{{name}}}" for name in scenes + ["mean"]) + r" \\",
             " & " + " & ".join(["short & long"] * (len(scenes) + 1)) + r" \\", r"\midrule"]
    for method, cells in table.items():
        lines.append(method + " & " + " & ".join(f"{text(c[0])} & {text(c[1])}" for c in cells.values()) + r" \\")
    return "\n".join(lines + [r"\bottomrule", r"\end{tabular}", ""])


def page(scenes, table, rows):
    def line(cells, tag="td"):
        return "<tr>" + "".join(f"<{tag}>{html.escape(str(c))}</{tag}>" for c in cells) + "</tr>"

    head = ["method"] + [f"{scene}, {gap}" for scene in scenes + ["mean"] for gap in ("short", "long", "to 2D")]
    body = [line([m] + [text(v, 2) for cell in cells.values() for v in cell]) for m, cells in table.items()]
    published = [line([name, text(short), text(long)]) for name, short, long in PAPER]
    all_rows = [line([text(row.get(key), 3) for key in COLUMNS]) for row in rows]
    return f"""<!doctype html><meta charset="utf-8"><title>consistency and fidelity</title>
<style>body{{font:15px/1.5 system-ui,sans-serif;margin:2rem;max-width:80rem}}table{{border-collapse:collapse;margin:1rem 0}}
td,th{{padding:.2rem .7rem;text-align:right;border-bottom:1px solid #ddd}}td:first-child,th:first-child{{text-align:left}}</style>
<h1>Consistency and fidelity</h1>
<p>TC-PSNR in dB between frames 1 and 5 apart, means over styles, and PSNR of the styled frames to those of the 2D method.
Grey or blurred films are also consistent: read both.</p>
<table>{line(head, "th")}{"".join(body)}</table>
<h2>As published</h2>
<p>The scene fern in LipRF's own table. Its flow, masks, frames and styles are not published, and 2D methods were
applied to photos or to other renders: the order of the rows can be compared, the values cannot.</p>
<table>{line(["method", "short", "long"], "th")}{"".join(published)}</table>
<h2>Every run</h2><table>{line(COLUMNS, "th")}{"".join(all_rows)}</table>
"""


def main():
    if len(sys.argv) != 2 or sys.argv[1] == "--help":
        print(__doc__)
        return 0 if "--help" in sys.argv else 2
    work = sys.argv[1]
    rows, seen = [], set()
    for kind in ("runs", "foreign"):
        for scene, style, method, report in reports(work, kind):
            for row in rows_of(scene, style, method, report):
                key = (row["scene"], row["style"], row["method"])
                if key not in seen:  # the renders without style are the same for every method
                    seen.add(key)
                    rows.append(row)
    if not rows:
        sys.exit(f"{work}/runs: no report.json of a finished run (did the jobs fail? see {work}/logs)")
    with open(os.path.join(work, "table.csv"), "w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    scenes, table = summary(rows)
    with open(os.path.join(work, "table.tex"), "w") as file:
        file.write(latex(scenes, table))
    with open(os.path.join(work, "table.html"), "w") as file:
        file.write(page(scenes, table, rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
