#!/usr/bin/env python3
"""Follows the published protocol of StyleGaussian's authors step by step in numpy: RMSE after forward warping.

  stylegaussian_consistency.py --frames DIR --flow DIR [--unstyled DIR --unstyled-flow DIR] [--gaps 1,7]

--frames are 8-bit PNG or PPM files in natural order, --flow has their motion as 00000_00001.flo of the frames' size, in
place of RAFT. Prints one JSON object: `rmse` of each pair as published, and with --unstyled and its flow `rmse_corrected`
(evaluate/PROTOCOLS.md has both readings). Shares no code with the program. Exit status: 0.
"""

import argparse
import json
import os
import sys

import numpy

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "tests", "evaluate"))
from reference_evaluator import read_flow, read_frames  # pylint: disable=wrong-import-position

BIAS = 1e-7  # added to the sum of weights


def padded(values):
    """Sides as multiples of 8, the border repeated on both sides (RAFT's InputPadder, its default)."""
    extra = [(-side) % 8 for side in values.shape[:2]]
    return numpy.pad(values, [(e // 2, e - e // 2) for e in extra] + [(0, 0)] * (values.ndim - 2), mode="edge")


def corners(x, y):
    """(column, row, weight) of the four pixels around each position."""
    left, top = numpy.floor(x), numpy.floor(y)
    for down in (0, 1):
        for right in (0, 1):
            weight = numpy.abs(1 - right - (x - left)) * numpy.abs(1 - down - (y - top))
            yield left + right, top + down, weight


def inside(column, row, shape):
    return (column >= 0) & (row >= 0) & (column < shape[1]) & (row < shape[0])


def backwarp(image, flow, scale):
    """image at x + scale * flow, bilinear, zeros outside."""
    height, width = image.shape[:2]
    y, x = numpy.mgrid[0:height, 0:width]
    result = numpy.zeros(image.shape)
    for column, row, weight in corners(x + scale[0] * flow[:, :, 0], y + scale[1] * flow[:, :, 1]):
        known = inside(column, row, image.shape)
        result[known] += weight[known, None] * image[row[known].astype(int), column[known].astype(int)]
    return result


def splat(values, flow):
    """values moved along the flow, each to the four pixels around its target."""
    height, width = values.shape[:2]
    y, x = numpy.mgrid[0:height, 0:width]
    result = numpy.zeros(values.shape)
    for column, row, weight in corners(x + flow[:, :, 0], y + flow[:, :, 1]):
        known = inside(column, row, values.shape)
        numpy.add.at(result, (row[known].astype(int), column[known].astype(int)), values[known] * weight[known, None])
    return result


def softmax_splat(moved, first, second, flow, scale, bias):
    """(the moved frame, the sum of its weights); values from 0 to 255."""
    finite = numpy.isfinite(flow).all(axis=2)
    flow = numpy.where(finite[:, :, None], flow, 0)
    difference = numpy.abs(first - backwarp(second, flow, scale)).mean(axis=2)
    importance = numpy.clip(-10 * difference, -10, 10)
    weight = (numpy.exp(importance) * finite)[:, :, None]
    total, norm = splat(moved * weight, flow), splat(weight, flow)
    with numpy.errstate(invalid="ignore"):
        return numpy.where(norm > 0, total / (norm + bias), 0), norm[:, :, 0]


def published(earlier, later, flow):
    earlier, later, flow = padded(earlier), padded(later), padded(flow)
    height, width = earlier.shape[:2]
    warped, _ = softmax_splat(earlier, earlier, later, flow, (width / (width - 1), height / (height - 1)), BIAS)
    mask = warped.sum(axis=2) != 0
    return numpy.sqrt(((warped / 255 - mask[:, :, None] * later / 255) ** 2).mean())


def corrected(earlier, later, unstyled_earlier, unstyled_later, flow):
    warped, norm = softmax_splat(earlier, unstyled_earlier, unstyled_later, flow, (1, 1), 0)
    mask = norm > 0
    return numpy.sqrt((((warped - later)[mask] / 255) ** 2).mean()) if mask.any() else None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", required=True, metavar="DIR", help="the measured frames")
    parser.add_argument("--flow", required=True, metavar="DIR", help="their own motion")
    parser.add_argument("--unstyled", metavar="DIR", help="the frames before styling")
    parser.add_argument("--unstyled-flow", metavar="DIR", help="their motion")
    parser.add_argument("--gaps", default="1,7", help="distances between compared frames (1,7)")
    options = parser.parse_args()
    frames = [255 * frame for frame in read_frames(options.frames)]
    unstyled = [255 * frame for frame in read_frames(options.unstyled)] if options.unstyled else None
    pairs = []
    for gap in [int(gap) for gap in options.gaps.split(",")]:
        for i in range(len(frames) - gap):
            j = i + gap
            pair = {"gap": gap, "from": i, "to": j,
                    "rmse": published(frames[i], frames[j], read_flow(options.flow, i, j))}
            if unstyled:
                pair["rmse_corrected"] = corrected(frames[i], frames[j], unstyled[i], unstyled[j],
                                                   read_flow(options.unstyled_flow, i, j))
            pairs.append(pair)
    json.dump({"pairs": pairs}, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
