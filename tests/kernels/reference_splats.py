#!/usr/bin/env python3
"""An independent renderer of 3D Gaussian splats in NumPy, from the papers' formulas as they are printed, and a comparison of
its pictures with those of kernels/splats: covariances are formed and inverted, harmonics are Legendre functions of angles.

  reference_splats.py SPLAT_PICTURE      exit status 77 (skipped) without numpy; SPLAT_PICTURE: the program of that name
"""

import itertools
import math
import os
import subprocess
import sys

SYSTEM_PYTHON = "/usr/bin/python3"  # the interpreter of Debian's python3-numpy
try:
    import numpy
except ImportError:
    if os.path.exists(SYSTEM_PYTHON) and "REGRADE_NUMPY_RETRIED" not in os.environ:
        os.execve(SYSTEM_PYTHON, [SYSTEM_PYTHON] + sys.argv, {**os.environ, "REGRADE_NUMPY_RETRIED": "1"})
    print("SKIPPED: numpy is missing (Debian: python3-numpy)")
    sys.exit(77)

TOLERANCE = 1e-12  # both are in double; inverses of covariances lose some digits
WIDTH, HEIGHT = 37, 26
NEAR, BLUR = 0.25, 0.3


def legendre(degree, order, x):
    """Associated Legendre function with the Condon-Shortley phase."""
    value = (-1) ** order * math.prod(range(1, 2 * order, 2)) * (1 - x * x) ** (order / 2)
    below = 0.0
    for n in range(order + 1, degree + 1):
        below, value = value, ((2 * n - 1) * x * value - (n + order - 1) * below) / (n - order)
    return value


def harmonics(degree, d):
    """Real spherical harmonics of a direction, by degree l and then m = -l..l."""
    longitude = math.atan2(d[1], d[0])
    values = []
    for l in range(degree + 1):
        for m in range(-l, l + 1):
            a = abs(m)
            scale = math.sqrt((2 * l + 1) / (4 * math.pi) * math.factorial(l - a) / math.factorial(l + a))
            part = 1 if m == 0 else math.sqrt(2) * (math.cos(m * longitude) if m > 0 else math.sin(a * longitude))
            values.append(scale * part * legendre(l, a, d[2]))
    return numpy.array(values)


def rotation(q):
    """Of a quaternion w, x, y, z, as the matrix of v -> q v q* / |q|^2."""
    w, v = q[0], numpy.asarray(q[1:])
    cross = numpy.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return ((w * w - v @ v) * numpy.eye(3) + 2 * numpy.outer(v, v) + 2 * w * cross) / (w * w + v @ v)


def project(scene, i):
    """(z, centre, covariance, opacity, colour) of a splat; None before the near plane."""
    world, turn = scene["mean"][i], scene["rotation"]
    x, y, z = turn @ world + scene["translation"]
    if z < NEAR:
        return None
    fx, fy, cx, cy = scene["intrinsics"]
    limit = [[((0.5 - side) * size - c) / f for side in (0.65, -0.65)] for size, c, f in ((WIDTH, cx, fx), (HEIGHT, cy, fy))]
    tx, ty = (min(max(value, low), high) for value, (low, high) in zip((x / z, y / z), limit))
    jacobian = numpy.array([[fx / z, 0, -fx * tx / z], [0, fy / z, -fy * ty / z]])
    factor = rotation(scene["quaternion"][i]) @ numpy.diag(numpy.exp(scene["log_scale"][i]))
    sharp = jacobian @ turn @ factor @ factor.T @ turn.T @ jacobian.T
    larger = 1 if scene["fit_pixel"] < 0 else fx * fy * scene["fit_pixel"] ** 2
    blurred, fitted = (sharp + BLUR * part * numpy.eye(2) for part in (max(1, larger), larger))
    opacity = 1 / (1 + math.exp(-scene["opacity_logit"][i]))
    opacity *= math.sqrt(max(0, numpy.linalg.det(fitted) / numpy.linalg.det(blurred)))
    direction = world + turn.T @ scene["translation"]
    gamma = harmonics(scene["degree"], direction / numpy.linalg.norm(direction))
    color = numpy.maximum(0, 0.5 + scene["sh"][i] @ gamma)
    return z, numpy.array([fx * x / z + cx, fy * y / z + cy]), numpy.linalg.inv(blurred), opacity, color


def render(scene):
    """[H, W, 6]: colour, sum of weight times z, median z, transmittance."""
    seen = [splat for splat in (project(scene, i) for i in range(len(scene["mean"]))) if splat]
    seen.sort(key=lambda splat: numpy.float32(splat[0]))
    picture = numpy.zeros((HEIGHT, WIDTH, 6))
    for row in range(HEIGHT):
        for column in range(WIDTH):
            color, depth, median, clear = numpy.zeros(3), 0.0, 0.0, 1.0
            for z, center, inverse, opacity, own in seen:
                offset = numpy.array([column + 0.5, row + 0.5]) - center
                alpha = min(0.99, opacity * math.exp(-0.5 * offset @ inverse @ offset))
                if alpha < 1 / 255:
                    continue
                if clear * (1 - alpha) < 1e-4:
                    break
                color += clear * alpha * own
                depth += clear * alpha * z
                if clear > 0.5 >= clear * (1 - alpha):
                    median = z
                clear *= 1 - alpha
            picture[row, column] = [*(color + clear * scene["background"]), depth, median, clear]
    return picture


def random_scene(seed, degree, fit_pixel, count):
    random = numpy.random.default_rng(seed)
    basis = (degree + 1) ** 2
    turn = rotation([1, *random.uniform(-0.2, 0.2, 3)])
    return {"degree": degree, "fit_pixel": fit_pixel, "rotation": turn,
            "translation": -turn @ random.uniform((-0.3, -0.3, -2.2), (0.3, 0.3, -1.8)),
            "intrinsics": random.uniform((35, 35, 16, 10), (42, 42, 21, 15)), "background": random.uniform(0, 1, 3),
            "mean": random.uniform(-1.9, 1.9, (count, 3)), "log_scale": random.uniform(-5, 0, (count, 3)),
            "quaternion": random.uniform(-3, 3, (count, 4)), "opacity_logit": random.uniform(-6, 6, count),
            "sh": random.uniform(-0.8, 0.8, (count, 3, basis))}


def picture_of_program(program, scene):
    count, basis = len(scene["mean"]), scene["sh"].shape[2]
    parts = [[WIDTH, HEIGHT, basis, count, scene["fit_pixel"], NEAR, BLUR], scene["intrinsics"], scene["rotation"],
             scene["translation"], scene["background"]]
    parts += [scene[name] for name in ("mean", "log_scale", "quaternion", "opacity_logit", "sh")]
    data = b"".join(numpy.asarray(part, "<f8").tobytes() for part in parts)
    values = numpy.frombuffer(subprocess.run([program], input=data, stdout=subprocess.PIPE, check=True).stdout, "<f8")
    pixels = WIDTH * HEIGHT
    return numpy.concatenate([values[:3 * pixels].reshape(HEIGHT, WIDTH, 3),
                              values[3 * pixels:].reshape(3, HEIGHT, WIDTH).transpose(1, 2, 0)], axis=2)


def main():
    if len(sys.argv) != 2:
        print(__doc__)
        return 2
    failures = 0
    for seed, (degree, fit_pixel) in enumerate(itertools.product(range(4), (-1, 0, 1 / 70, 1 / 25))):
        scene = random_scene(30 + seed, degree, fit_pixel, 60)
        expected, got = render(scene), picture_of_program(sys.argv[1], scene)
        worst = numpy.abs(expected - got).max()
        covered = (expected[..., 5] < 0.5).mean()
        print(f"degree {degree}, pixel of the fit {fit_pixel:.3f}: {worst:.1e} at most, {covered:.0%} of the pixels covered")
        failures += not (worst <= TOLERANCE and covered > 0.1)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
