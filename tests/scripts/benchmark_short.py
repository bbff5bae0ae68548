#!/usr/bin/env python3
"""The benchmark at its smallest: one scene, one style, one method, two seeds and the frames of another program.

  benchmark_short.py REGRADE

Runs scripts/benchmark with Snakemake and checks its tables; the means and spreads are computed here from the reports, too.
Exit status: 0, 1 with a finding, or 77 where Snakemake is missing; Debian's needs 700 MB.
"""

import csv
import glob
import json
import math
import os
import shutil
import statistics
import subprocess
import sys
import tempfile

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../..")
OPTIONS = "--photo-size 88 --splat-steps 60 --splats 2"
CONFIG = """
regrade: {regrade}
work: {work}
preset: draft
options: {options}
seeds: [0, 1]
scenes:
  table: {{synth: --scene table --views 10 --size 88x66, role: chosen on}}
styles:
  sunset: {root}/assets/style_sunset.png
methods:
  MKL: --method mkl --mode geometry --style-steps 10
first_seed: --controls field
results: {results}
foreign: {{other: "{work}/runs/{{scene}}/{{style}}/MKL/0/styles/style/frames/views_2d"}}
"""


def tc_of(file, sequence, gap):
    with open(file) as stream:
        rows = json.load(stream)["consistency"]
    return next(r["tc_psnr_mean_db"] for r in rows if r["sequence"] == sequence and r["gap"] == gap)


def main():
    if len(sys.argv) != 2:
        print(__doc__)
        return 2
    if shutil.which("snakemake") is None:
        print("snakemake is not installed")
        return 77
    with tempfile.TemporaryDirectory() as folder:
        work, config = os.path.join(folder, "work"), os.path.join(folder, "config.yaml")
        results = os.path.join(folder, "RESULTS.md")
        with open(results, "w") as file:
            file.write("before\n<!-- core -->\nold\n<!-- end of core -->\nafter\n")
        with open(config, "w") as file:
            file.write(CONFIG.format(regrade=os.path.abspath(sys.argv[1]), work=work, options=OPTIONS, root=ROOT, results=results))
        # Snakemake keeps its state beside the Snakefile.
        shutil.copytree(os.path.join(ROOT, "scripts/benchmark"), os.path.join(folder, "benchmark"),
                        ignore=shutil.ignore_patterns(".snakemake"))
        done = subprocess.run(["snakemake", "--cores", "2", "--configfile", config], cwd=os.path.join(folder, "benchmark"),
                              capture_output=True, text=True, env={**os.environ, "HOME": folder})
        if done.returncode != 0:
            print(done.stdout[-2000:], done.stderr[-4000:])
            for log in glob.glob(os.path.join(work, "logs/*")):
                with open(log) as file:
                    print(log, file.read()[-600:])
            return 1
        with open(os.path.join(work, "table.csv")) as file:
            rows = list(csv.DictReader(file))
        with open(os.path.join(work, "table.md")) as file:
            page = file.read()
        found = {(row["method"], row["seed"]) for row in rows}
        wanted = {(method, seed) for method in ("no style", "MKL", "MKL w/ Lip") for seed in "01"}
        wanted |= {("other", "0"), ("MKL, field fitted", "0")}
        assert found == wanted, found
        reports = [os.path.join(work, f"runs/table/sunset/MKL/{seed}/styles/style/report.json") for seed in (0, 1)]
        tc = [tc_of(report, "styled", 1) for report in reports]
        for row in rows:
            if row["method"] == "MKL w/ Lip":
                assert math.isclose(float(row["short_db"]), tc[int(row["seed"])], abs_tol=1e-9), row
                assert row["motion"] == "geometry", row
            if row["method"] == "MKL, field fitted":
                report = reports[int(row["seed"])]
                assert math.isclose(float(row["short_db"]), tc_of(report, "control_field_2d", 1), abs_tol=1e-9), row
                assert float(row["to_2d_db"]) > 10 and row["hue_spread"], row
        cell = f"{statistics.fmean(tc):.2f} ± {statistics.stdev(tc):.2f}"
        assert f"| table | chosen on | MKL w/ Lip | geometry | {cell} |" in page, (cell, page)
        assert tc[0] != tc[1], "another seed changes nothing"
        with open(results) as file:
            text = file.read()
        assert text.startswith("before\n<!-- core -->\n3 runs, ") and text.endswith("\n<!-- end of core -->\nafter\n"), text
        assert cell in text and "old" not in text and " cores" in text, text
        of_2d = statistics.fmean(tc_of(report, "views_2d", 1) for report in reports)
        # LipRF's table of the same runs, as if the scene were its fern.
        shutil.move(os.path.join(work, "runs/table"), os.path.join(work, "runs/fern"))
        subprocess.run([sys.executable, os.path.join(ROOT, "scripts/benchmark/make_table.py"), work, "--as-printed"], check=True)
        with open(os.path.join(work, "table1.md")) as file:
            printed = file.read()
        assert f"| short | MKL | exact | {of_2d:.1f} ({of_2d - 28.4:+.1f}) |" in printed, printed
        shutil.move(os.path.join(work, "runs/fern"), os.path.join(work, "runs/table"))
        frames = [len(glob.glob(os.path.join(work, place, "*.png"))) for place in
                  ("example/table/sunset", "runs/table/sunset/MKL/0/styles/style/frames/source")]
        assert frames[0] == frames[1] == 10, frames
    return 0


if __name__ == "__main__":
    sys.exit(main())
