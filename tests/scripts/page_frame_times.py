"""Compares a packed scene's picture with the browser's and times its frames; a module of page_frames.py."""

import base64
import json
import math
import statistics
import time

from gles import Gl
from page_scene import SMALL, Scene

def compare(scene):
    """Decibels from the browser's picture without opacity steps, and the part of the values within 1 of 255."""
    small = scene.about["small"]
    scene.prepare(small, SMALL, 0.0)
    scene.draw()
    got, want, width = scene.pixels(), base64.b64decode(small["pixels"]), SMALL[0]
    rows = [got[4 * width * y:4 * width * (y + 1)] for y in reversed(range(SMALL[1]))]
    flat = bytes(b for row in rows for i, b in enumerate(row) if i % 4 < 3)
    error = sum((a - b) ** 2 for a, b in zip(flat, want)) / len(want)
    return (99 if error == 0 else 10 * math.log10(255 ** 2 / error)), sum(abs(a - b) <= 1 for a, b in zip(flat, want)) / len(want)


def measure(scene, size, mode, frames):
    gl, views = scene.gl, scene.about["views"]
    step = scene.about["steps"].get(mode, 0)
    fetches, waited, flowing = [], [], []
    for view in views:
        scene.prepare(view, SMALL, step, True)
        scene.draw()
        counts = scene.pixels()
        fetches.append(sum(counts[k] + 256 * counts[k + 1] for k in range(0, len(counts), 4)) / (SMALL[0] * SMALL[1]))
        scene.prepare(view, size, step)
        each, warm = max(2, math.ceil(frames / len(views))), min(10, max(1, frames // 10))
        for i in range(warm + each):
            begun = time.perf_counter()
            scene.draw()
            gl.Finish()
            if i >= warm:
                waited.append(1000 * (time.perf_counter() - begun))
        begun = time.perf_counter()
        for _ in range(each):
            scene.draw()
            gl.Flush()
        gl.Finish()
        flowing.append(1000 * (time.perf_counter() - begun) / each)
    median, mean = statistics.median(waited), sum(fetches) / len(fetches)
    return {"mode": mode, "width": size[0], "height": size[1], "frames": len(waited), "ms_median": median,
            "ms_p95": sorted(waited)[int(0.95 * (len(waited) - 1))], "fps": 1000 / median,
            "ms_median_by_view": [statistics.median(waited[i * each:(i + 1) * each]) for i in range(len(views))],
            "ms_without_waiting": statistics.mean(flowing), "fetches_a_ray": mean,
            "fetches_a_second": mean * size[0] * size[1] * 1000 / median}


def time_frames(arguments):
    gl = Gl(arguments.device)
    scene = Scene(gl, arguments.folder, arguments.compute)
    decibels, near = compare(scene)
    result = {"renderer": gl.renderer, "version": gl.version, "display": gl.display, "shader": "compute" if arguments.compute else "fragment",
              "page": scene.about["page"], "voxels": scene.about["voxels"], "styled": scene.about["styled"],
              "graphics_bytes": scene.about["graphics_bytes"], "db_to_browser": decibels, "within_one": near, "modes": []}
    print(f"{gl.renderer}, {gl.version}, {gl.display}: {decibels:.1f} dB from the browser's picture, {100 * near:.2f} % within 1 of 255", flush=True)
    size = tuple(map(int, arguments.size.split("x")))
    for mode in arguments.modes.split(","):
        got = measure(scene, size, mode, arguments.frames)
        result["modes"].append(got)
        print(f"{mode:6} {size[0]} x {size[1]}: {got['ms_median']:.2f} ms a frame ({got['ms_p95']:.2f} at the 95th percentile of {got['frames']}), "
              f"{got['fps']:.1f} frames/s; {got['ms_without_waiting']:.2f} ms without waiting; {got['fetches_a_ray']:.1f} fetches a ray, "
              f"{got['fetches_a_second'] / 1e9:.2f} G/s", flush=True)
    error = gl.GetError()
    if arguments.out:
        with open(arguments.out, "w", encoding="utf-8") as file:
            json.dump(result, file, indent=1)
    # Another processor's arithmetic, as page_pictures.py's bounds.
    if error or decibels < 50:
        print(f"the picture differs from the browser's, or OpenGL reports {error}")
        return 1
    return 0
