#!/usr/bin/env python3
"""Measures the distances of frames to a style picture and to other frames in numpy, as an independent check of
`regrade evaluate`; shares no code with the program.

  reference_fidelity.py --frames DIR --reference DIR --style FILE --weights FILE.npz

Pictures are 8-bit PNG or PPM. The networks are the small ones of tiny_networks.py, run here with the weights of the .npz
file. Prints one JSON object with the keys of report.json's `fidelity`. Exit status: 0.
"""

import argparse
import json
import math
import sys

import numpy
from reference_evaluator import read_frame, read_frames


def network_input(picture):
    """[3, height, width] from -1 to 1."""
    return 2 * picture.transpose(2, 0, 1) - 1


def conv(weights, bias, x):
    """A convolution of single pixels."""
    return numpy.einsum("oc,chw->ohw", weights, x) + bias[:, None, None]


def lpips_like(w, a, b):
    """Differences of unit feature vectors, weighted: the form of LPIPS with one layer."""
    def unit(picture):
        f = numpy.maximum(conv(w["lpips"], w["lpips_bias"], network_input(picture)), 0)
        return f / (numpy.sqrt((f ** 2).sum(axis=0, keepdims=True)) + 1e-3)
    return float(numpy.einsum("c,chw->hw", w["heads"], (unit(a) - unit(b)) ** 2).mean())


def gradient_edges(picture):
    grey = picture.mean(axis=2)
    dx, dy = numpy.zeros_like(grey), numpy.zeros_like(grey)
    dx[:, :-1], dy[:-1, :] = numpy.diff(grey, axis=1), numpy.diff(grey, axis=0)
    square = dx ** 2 + dy ** 2
    return square / (square + square.mean())


def network_edges(w, picture):
    return 1 / (1 + numpy.exp(-conv(w["edges"], w["edges_bias"], network_input(picture))[0]))


def ssim(a, b):
    """Wang et al. 2004 of one channel: windows 11 x 11 inside the picture, sigma 1.5."""
    taps = numpy.exp(-(numpy.arange(11) - 5) ** 2 / (2 * 1.5 ** 2))
    kernel = numpy.outer(taps, taps) / taps.sum() ** 2
    mean = lambda m: numpy.einsum("yxij,ij->yx", numpy.lib.stride_tricks.sliding_window_view(m, (11, 11)), kernel)
    ma, mb = mean(a), mean(b)
    va, vb, cov = mean(a * a) - ma * ma, mean(b * b) - mb * mb, mean(a * b) - ma * mb
    return (((2 * ma * mb + 1e-4) * (2 * cov + 9e-4)) / ((ma ** 2 + mb ** 2 + 1e-4) * (va + vb + 9e-4))).mean()


def random_double(seed, stream, counter):
    """The program's random numbers, which its 64 directions are made of (kernels/base/random.h)."""
    def mix(x):
        x = (x + 0x9e3779b97f4a7c15) % 2 ** 64
        x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9 % 2 ** 64
        x = (x ^ x >> 27) * 0x94d049bb133111eb % 2 ** 64
        return x ^ x >> 31
    return (mix(mix(mix(seed) ^ stream) ^ counter) >> 11) * 2.0 ** -53


def quantiles(values, levels):
    """Of the empirical distribution, linear between the ranks k + 1/2."""
    return numpy.interp(levels, (numpy.arange(len(values)) + 0.5) / len(values), numpy.sort(values))


def sliced_wasserstein(frames, style):
    """Sorted projections instead of the program's bins."""
    levels, total = (numpy.arange(1024) + 0.5) / 1024, 0
    for i in range(64):
        z, angle = 2 * random_double(2023, 0, i) - 1, 2 * math.pi * random_double(2023, 1, i)
        direction = numpy.array([math.sqrt(1 - z * z) * math.cos(angle), math.sqrt(1 - z * z) * math.sin(angle), z])
        a = numpy.concatenate([frame.reshape(-1, 3) @ direction for frame in frames])
        total += ((quantiles(a, levels) - quantiles(style.reshape(-1, 3) @ direction, levels)) ** 2).sum()
    return math.sqrt(total / (64 * 1024))


def measure(frames, reference, style, w):
    return {
        "lpips_to_2d": numpy.mean([lpips_like(w, a, b) for a, b in zip(frames, reference)]),
        "sliced_wasserstein_to_style": sliced_wasserstein(frames, style),
        "edge_ssim": numpy.mean([ssim(gradient_edges(a), gradient_edges(b)) for a, b in zip(frames, reference)]),
        "edge_ssim_by_network": numpy.mean([ssim(network_edges(w, a), network_edges(w, b)) for a, b in zip(frames, reference)]),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", required=True, metavar="DIR")
    parser.add_argument("--reference", required=True, metavar="DIR", help="the unstyled frames")
    parser.add_argument("--style", required=True, metavar="FILE", help="8-bit PNG")
    parser.add_argument("--weights", required=True, metavar="FILE", help="written by tiny_networks.py")
    options = parser.parse_args()
    weights = {name: values.astype(float) for name, values in numpy.load(options.weights).items()}
    json.dump(measure(read_frames(options.frames), read_frames(options.reference), read_frame(options.style), weights),
              sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
