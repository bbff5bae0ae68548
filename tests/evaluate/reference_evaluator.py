#!/usr/bin/env python3
"""Measures the temporal consistency of frames in numpy, as an independent check of `regrade evaluate`.

  reference_evaluator.py --frames DIR --flow DIR [--mode lai2018|ruder2016] [--gaps 1,5]
                         [--warp later|earlier] [--error-per channel|pixel]

The DIR of --frames has 8-bit PNG or PPM files in natural order, the DIR of --flow the files 00000_00001.flo (motion from
frame 0 to frame 1) and 00001_00000.flo (backward). Prints one JSON object. Shares no code with the program.

Three points depart from the published definitions, as in the program: pairs without a trusted pixel are undefined
(Lai et al.: error 0); non-finite flow is not trusted; in mode ruder2016 a pixel whose target is outside the frame
keeps weight 0 after the smoothing. Exit status: 0.
"""

import argparse
import json
import os
import re
import struct
import sys
import zlib

import numpy


def unfiltered(rows, stride, channels):
    """PNG rows with their filters undone (PNG 1.2, chapter 6)."""
    above = numpy.zeros(stride, int)
    for row in rows:
        kind, line = row[0], row[1:].astype(int)
        if kind == 2:
            line = (line + above) % 256
        elif kind in (1, 3, 4):
            for i in range(stride):
                a = line[i - channels] if i >= channels else 0
                b, c = above[i], above[i - channels] if i >= channels else 0
                p = a + b - c
                paeth = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
                line[i] = (line[i] + {1: a, 3: (a + b) // 2, 4: paeth}[kind]) % 256
        yield line
        above = line


def read_png(data):
    chunks, at = [], 8
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        chunks.append((kind, data[at + 8:at + 8 + size]))
        at += size + 12
    width, height, bits, colour, _, _, interlaced = struct.unpack(">IIBBBBB", chunks[0][1])
    if bits != 8 or colour not in (0, 2, 6) or interlaced:
        raise ValueError("only grey, RGB and RGBA of 8 bits, not interlaced")
    channels = {0: 1, 2: 3, 6: 4}[colour]
    stored = zlib.decompress(b"".join(body for kind, body in chunks if kind == b"IDAT"))
    rows = numpy.frombuffer(stored, numpy.uint8).reshape(height, 1 + width * channels)
    pixels = numpy.array(list(unfiltered(rows, width * channels, channels)))
    return pixels.reshape(height, width, channels)[:, :, :3] / 255.0


def read_ppm(data):
    head = re.match(rb"P6\s+(\d+)\s+(\d+)\s+255\s", data)
    width, height = int(head[1]), int(head[2])
    return numpy.frombuffer(data[head.end():], numpy.uint8).reshape(height, width, 3) / 255.0


def read_frame(path):
    with open(path, "rb") as file:
        data = file.read()
    return read_png(data) if data.startswith(b"\x89PNG") else read_ppm(data)


def natural_order(name):
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]


def read_frames(folder):
    names = sorted((n for n in os.listdir(folder) if n.endswith((".png", ".ppm"))), key=natural_order)
    return [read_frame(os.path.join(folder, name)) for name in names]


def read_flow(folder, i, j):
    """[height, width, 2], pixels; NaN where the file marks the motion as unknown."""
    with open(os.path.join(folder, f"{i:05d}_{j:05d}.flo"), "rb") as file:
        mark, width, height = struct.unpack("<fii", file.read(12))
        flow = numpy.fromfile(file, "<f4").astype(float).reshape(height, width, 2)
    if mark != 202021.25:
        raise ValueError("not a .flo file")
    with numpy.errstate(invalid="ignore"):
        flow[~(numpy.abs(flow) <= 1e9).all(axis=2)] = numpy.nan
    return flow


def targets(flow):
    """The positions (x, y) of the first frame's pixels in the second frame."""
    height, width = flow.shape[:2]
    y, x = numpy.mgrid[0:height, 0:width]
    return x + flow[:, :, 0], y + flow[:, :, 1]


def bilinear(values, x, y):
    """values[y, x] between pixels, tap indices clamped to the border; NaN at positions that are NaN."""
    height, width = values.shape[:2]
    known = numpy.isfinite(x) & numpy.isfinite(y)
    # Indices are clamped to the border below; this bound keeps the conversion to integers defined.
    x, y = (numpy.clip(numpy.where(known, p, 0), -9, side + 9) for p, side in ((x, width), (y, height)))
    left, top = numpy.floor(x).astype(int), numpy.floor(y).astype(int)
    total = 0
    for row, column, weight in ((0, 0, (1 - (x - left)) * (1 - (y - top))), (0, 1, (x - left) * (1 - (y - top))),
                                (1, 0, (1 - (x - left)) * (y - top)), (1, 1, (x - left) * (y - top))):
        tap = values[numpy.clip(top + row, 0, height - 1), numpy.clip(left + column, 0, width - 1)]
        # A tap of weight 0 is ignored, even if it is NaN.
        total = total + numpy.where(weight[:, :, None] > 0, tap, 0) * weight[:, :, None]
    return numpy.where(known[:, :, None], total, numpy.nan)


def squared(vectors):
    return (vectors ** 2).sum(axis=2)


def finite(vectors):
    return numpy.isfinite(vectors).all(axis=2)


def mask_lai2018(forward, backward):
    """Lai et al. 2018: hard mask, forward differences, targets out of the frame are kept."""
    back = bilinear(backward, *targets(forward))
    occluded = squared(back + forward) > 0.01 * (squared(back) + squared(forward)) + 0.5
    energy = numpy.zeros(forward.shape[:2])
    energy[:, :-1] += squared(forward[:, 1:] - forward[:, :-1])
    energy[:-1, :] += squared(forward[1:, :] - forward[:-1, :])
    boundary = energy > 0.01 * squared(forward) + 0.002
    mask = (~occluded & ~boundary).astype(float)
    return mask * (finite(forward) & finite(back))


def smoothed(values):
    """Gaussian of sigma 0.8 to twice its width, by columns and rows; mirrored at the frame's edge."""
    taps = numpy.exp(-numpy.arange(-2, 3) ** 2 / (2 * 0.8 ** 2))
    for axis in (1, 0):
        wide = numpy.pad(values, [(2, 2) if a == axis else (0, 0) for a in (0, 1)], mode="symmetric")
        values = sum(tap * numpy.roll(wide, -k, axis) for k, tap in enumerate(taps / taps.sum()))
        values = numpy.delete(values, numpy.s_[-4:], axis)
    return values


def mask_ruder2016(forward, backward):
    """Ruder et al. 2016: soft mask, central differences, smoothed from -255, 0 and 255."""
    height, width = forward.shape[:2]
    x, y = targets(forward)
    with numpy.errstate(invalid="ignore"):
        inside = ((numpy.floor(x) >= 0) & (numpy.floor(x) + 1 < width) &
                  (numpy.floor(y) >= 0) & (numpy.floor(y) + 1 < height))
    back = bilinear(backward, x, y)
    disoccluded = squared(forward + back) >= 0.01 * (squared(forward) + squared(back)) + 0.5
    wide = numpy.pad(forward, [(1, 1), (1, 1), (0, 0)], mode="symmetric")
    energy = (squared(wide[1:-1, 2:] - wide[1:-1, :-2]) + squared(wide[2:, 1:-1] - wide[:-2, 1:-1])) / 4
    boundary = energy > 0.01 * squared(forward) + 0.002
    sampled = inside & finite(forward) & finite(back)
    values = numpy.where(~sampled, 0, numpy.where(disoccluded, -255, numpy.where(boundary, 0, 255)))
    weight = numpy.clip(smoothed(values.astype(float)), 0, 255) / 255
    return weight * sampled


MASKS = {"lai2018": mask_lai2018, "ruder2016": mask_ruder2016}


def compare(fixed, moved, flow, mask, error_per):
    """(mean squared error over trusted pixels of `fixed`, fraction of trusted pixels)"""
    # Pixels of weight 0 are ignored, even if their target is unknown.
    warped = numpy.where(mask[:, :, None] > 0, bilinear(moved, *targets(flow)), fixed)
    total = ((mask[:, :, None] * (warped - fixed)) ** 2).sum()
    if mask.sum() == 0:
        return None, 0.0
    return total / ((fixed.shape[2] if error_per == "channel" else 1) * mask.sum()), mask.mean()


def decibel(error):
    return None if error is None else float("inf") if error == 0 else -10 * numpy.log10(error)


def evaluate(frames, flow_folder, mode, gaps, warp, error_per):
    pairs = []
    for gap in gaps:
        for i in range(len(frames) - gap):
            fixed, moved = (i, i + gap) if warp == "later" else (i + gap, i)
            there, back = read_flow(flow_folder, fixed, moved), read_flow(flow_folder, moved, fixed)
            with numpy.errstate(invalid="ignore"):
                mask = MASKS[mode](there, back)
            error, coverage = compare(frames[fixed], frames[moved], there, mask, error_per)
            pairs.append({"gap": gap, "from": i, "to": i + gap, "error": error, "tc_psnr_db": decibel(error),
                          "coverage": coverage})
    return pairs


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", required=True, metavar="DIR", help="8-bit PNG or PPM files")
    parser.add_argument("--flow", required=True, metavar="DIR", help="files 00000_00001.flo and 00001_00000.flo")
    parser.add_argument("--mode", choices=sorted(MASKS), default="lai2018")
    parser.add_argument("--gaps", default="1,5", help="distances between compared frames (1,5)")
    parser.add_argument("--warp", choices=("later", "earlier"), default="later", help="the frame that is sampled at the other's pixels")
    parser.add_argument("--error-per", choices=("channel", "pixel"), default="channel",
                        help="whether the sum of squares is divided by channels of pixels, or by pixels")
    options = parser.parse_args()
    gaps = [int(gap) for gap in options.gaps.split(",")]
    pairs = evaluate(read_frames(options.frames), options.flow, options.mode, gaps, options.warp, options.error_per)
    json.dump({"mode": options.mode, "pairs": pairs}, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
