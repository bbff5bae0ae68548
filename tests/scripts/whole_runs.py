#!/usr/bin/env python3
"""Whole runs of the program on small synthetic captures, from their beginning to the report.

  whole_runs.py REGRADE photos      a folder of photos without poses: COLMAP finds them
  whole_runs.py REGRADE splats      poses given
  whole_runs.py REGRADE paper       --preset paper, poses given; OVERRIDDEN names what is smaller, all else is to the letter

Each takes about a minute on two cores. Exit status: 0, 1 with what is wrong, or 77 without COLMAP.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile

from small_run import STYLE, STYLED

# What a fit of seconds needs; resolutions also bound memory.
OVERRIDDEN = {"fit-resolutions": "16,24,32", "fit-steps": "60,60,80", "fit-rays": "512", "background-resolution": "32"}
STYLE_STEPS = ["--style-steps", "6"]  # 300 in the paper
SHORT_FILM = ["--film-seconds", "0.25"]  # the paper has none


def run(command):
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          errors="replace", timeout=600, check=False)
    if done.returncode != 0:
        sys.exit(f"exit status {done.returncode} of {' '.join(command)}\n{done.stdout[-3000:]}")


def synth(regrade, folder, views, size):
    run([regrade, "synth", folder, "--scene", "table", "--views", str(views), "--size", size])


def report_of(out):
    with open(os.path.join(out, STYLED, "report.json"), encoding="utf-8") as file:
        return json.load(file)


def expect(holds, what):
    if not holds:
        sys.exit("FAILED: " + what)


def from_photos(regrade, work):
    """Photos alone: stages pose (COLMAP), reconstruct, style_2d, stylize, render, evaluate and report."""
    views = 16
    synth(regrade, os.path.join(work, "capture"), views, "400x300")
    photos, out = os.path.join(work, "photos"), os.path.join(work, "out")
    shutil.copytree(os.path.join(work, "capture", "images"), photos)
    # Every eighth photo is held out; a field of this size reaches 20 dB there, a wrong pose costs more than 5 dB.
    run([regrade, "run", photos, "--style", STYLE, "--out", out, "--preset", "draft", "--device", "cpu", "--photo-size", "200",
         "--splat-steps", "300", "--splats", "5", "--style-steps", "40", "--config", '{"style-rays": 1024}', *SHORT_FILM, "--film-size", "200", "--require", "reconstruct:psnr-heldout>=20,styled:tc-psnr:1>=20"])
    report = report_of(out)
    stages = report["stages"]
    expect(stages["pose"]["registered"] == views, f"COLMAP placed {stages['pose']['registered']} of {views} photos")
    expect(stages["pose"]["points"] > 100, "too few points of COLMAP")
    for name in ("reconstruct", "style_2d", "stylize", "render", "evaluate"):
        expect(name in stages, f"the report has no stage {name}")
    for name in ("field.npz", STYLED + "/network.npz", STYLED + "/report.html"):
        expect(os.path.getsize(os.path.join(out, name)) > 1000, f"{name} is missing or empty")


def splats(regrade, work):
    """A field of splats, from the fit to the page, the evaluator and other programs' file."""
    synth(regrade, os.path.join(work, "capture"), 12, "200x150")
    out, ply = os.path.join(work, "out"), os.path.join(work, "ply")
    command = [regrade, "run", os.path.join(work, "capture", "truth"), "--style", STYLE, "--out", out, "--preset", "smoke",
               "--device", "cpu", "--splat-steps", "300", "--photo-size", "200", "--style-steps", "40", "--page",
               "on", *SHORT_FILM, "--require", "reconstruct:psnr-heldout>=20,styled:tc-psnr:1>=20"]
    run(command)
    fit = report_of(out)["stages"]["reconstruct"]
    expect(fit["splats"] > 1000 and "voxels" not in fit, f"the fit is not of splats: {fit}")
    for name in ("field.npz", STYLED + "/network.npz", STYLED + "/report.html", STYLED + "/scene.html"):
        expect(os.path.getsize(os.path.join(out, name)) > 1000, f"{name} is missing or empty")
    # Two more styles, side by side.
    others = [os.path.join(os.path.dirname(STYLE), f"style_{name}.png") for name in ("night", "autumn")]
    at_once = [subprocess.Popen([regrade, "stylize", out, "--style", style, "--until", "stylize", "--threads", "1"], stdin=subprocess.DEVNULL,
                                stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) for style in others]
    for process in at_once:
        _, error = process.communicate(timeout=600)
        expect(process.returncode == 0, f"two styles at once: {error}")
    run([regrade, "export", out, "--format", "ply", "--out", ply])
    sizes = [os.path.getsize(os.path.join(ply, name)) for name in os.listdir(ply) if name.endswith(".ply")]
    expect(len(sizes) == 4 and min(sizes) > 1000 * 100, f"splats of the scene and of its styles: {os.listdir(ply)}")


def paper(regrade, work):
    """The preset of the paper, by the configuration that the capture asks for."""
    synth(regrade, os.path.join(work, "capture"), 10, "160x120")
    out = os.path.join(work, "out")
    smaller = ["--config", json.dumps(OVERRIDDEN)]
    command = [regrade, "run", os.path.join(work, "capture", "truth"), "--style", STYLE, "--out", out, "--preset", "paper", "--device",
               "cpu", *smaller, *STYLE_STEPS, *SHORT_FILM]
    run(command)
    run(command)  # nothing is done again: the choice is the same
    fit = report_of(out)["stages"]["reconstruct"]
    expect(fit["paper_config"].startswith("custom: "), f"configuration {fit['paper_config']}")
    for stage, options in ((fit, sorted(OVERRIDDEN)), (report_of(out)["stages"]["stylize"], ["style-steps"])):
        named = sorted(sentence.split()[0] for sentence in stage["not_to_the_letter"])
        expect(named == options, f"not to the letter: {stage['not_to_the_letter']}")
    expect(fit["sh_degree"] == 2, "the degree was tried")
    for config, word in (("syn", "transparent"), ("llff", "one way")):
        refused = subprocess.run([regrade, "run", os.path.join(work, "capture", "truth"), "--style", STYLE, "--out", out + config,
                                  "--preset", "paper", "--config", json.dumps({"paper-config": config})], stdin=subprocess.DEVNULL, capture_output=True,
                                 text=True, check=False)
        expect(refused.returncode == 2 and word in refused.stderr, f"paper-config {config} is not refused: {refused.stderr}")


def main():
    kinds = {"photos": from_photos, "splats": splats, "paper": paper}
    if len(sys.argv) != 3 or sys.argv[2] not in kinds:
        sys.exit(__doc__)
    if sys.argv[2] == "photos" and shutil.which("colmap") is None:
        sys.exit(77)
    with tempfile.TemporaryDirectory() as work:
        kinds[sys.argv[2]](sys.argv[1], work)
    print("ok")


if __name__ == "__main__":
    main()
