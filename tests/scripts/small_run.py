"""A synthetic capture and options for a run of seconds, and a comparison of its results; a module of other scripts."""

import hashlib
import json
import os
import subprocess

SMALL = ["--photo-size", "96", "--splat-steps", "200", "--splats", "2", "--style-steps", "20", "--config", '{"style-rays": 512}', "--film-seconds", "0.25", "--film-size", "96", "--preset", "draft", "--reproducible",
         "--holdout", "0", "--tracks", "given"]
STAGES = ("pose", "reconstruct", "style_2d", "stylize", "render", "evaluate", "report")
STYLED = "styles/style_sunset"  # the folder of a run's style
STYLE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../assets/style_sunset.png")
# Keys of the report that differ from run to run.
TIMES = {"seconds", "cpu_seconds", "frames_per_second", "peak_memory_mb"}


def make_capture(regrade, folder, effects=""):
    """Makes eight photos in FOLDER/images; returns the folder that also has their true poses, which needs no COLMAP."""
    subprocess.run([regrade, "synth", folder, "--scene", "table", "--views", "8", "--size", "256x192", "--effects", effects], check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return os.path.join(folder, "truth")


def call(command, **more):
    """(exit status, standard error)"""
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                          text=True, errors="replace", timeout=600, **more)
    return done.returncode, done.stderr.strip()


def leaves(value, name=""):
    """path -> value of each number and text of a report except times."""
    if not isinstance(value, (dict, list)):
        return {name: value}
    found = {}
    for key, member in value.items() if isinstance(value, dict) else enumerate(value):
        if key not in TIMES and not (name == "report.json" and key in ("command", "threads")):
            found.update(leaves(member, f"{name}.{key}"))
    return found


def results(folder):
    """name -> digest of every field, network and frame, and each value of the report except times."""
    found = {}
    for place, _, names in os.walk(folder):
        relative = os.path.relpath(place, folder)
        for name in names:
            path = os.path.join(place, name)
            if relative == STYLED and name == "report.json":
                with open(path, encoding="utf-8") as file:
                    found.update(leaves(json.load(file), name))
            elif name.endswith((".npz", ".mp4")) or {"frames", "views_2d"} & set(relative.split(os.sep)):
                with open(path, "rb") as file:
                    found[os.path.normpath(os.path.join(relative, name))] = hashlib.sha256(file.read()).hexdigest()
    return found


def different(now, expected):
    return sorted(name for name in set(now) | set(expected) if now.get(name) != expected.get(name))
