#!/usr/bin/env python3
"""Draws assets/style_sunset.png, the style picture of the quickstart: a made-up sunset over hills and water."""

import math
import os
import struct
import zlib

WIDTH, HEIGHT = 256, 192
HORIZON, SUN = 0.58, (0.64, 0.47)
SKY = ((0.00, (38, 30, 92)), (0.30, (122, 48, 128)), (0.50, (226, 92, 92)), (0.72, (250, 160, 72)),
       (1.00, (255, 226, 140)))
HILLS = ((0.50, 0.045, 9.0, 1.3, (104, 62, 116)), (0.54, 0.035, 15.0, 4.1, (62, 44, 92)))


def mix(a, b, t):
    return tuple(x + (y - x) * t for x, y in zip(a, b))


def ramp(stops, t):
    for (t0, c0), (t1, c1) in zip(stops, stops[1:]):
        if t <= t1:
            return mix(c0, c1, (t - t0) / (t1 - t0))
    return stops[-1][1]


def sky(x, y):
    colour = ramp(SKY, min(1.0, y / HORIZON))
    cloud = math.sin(9 * x + 24 * y + 1.5 * math.sin(7 * x)) * math.sin(31 * y + 2 * x)
    colour = mix(colour, (255, 120, 110), 0.35 * max(0.0, cloud) * (1 - y / HORIZON))
    distance = math.hypot((x - SUN[0]) * WIDTH / HEIGHT, y - SUN[1])
    colour = mix(colour, (255, 214, 120), 0.6 * math.exp(-(distance / 0.16) ** 2))
    return (255, 247, 214) if distance < 0.055 else colour


def picture(x, y):
    """Colour at x, y in [0, 1], y downwards."""
    if y < HORIZON:
        colour = sky(x, y)
        for base, height, frequency, phase, hill in HILLS:
            if y > base + height * math.sin(frequency * x + phase) * math.cos(3.1 * x + phase):
                colour = mix(hill, colour, 0.15)
        return colour
    depth = (y - HORIZON) / (1 - HORIZON)
    ripple = 0.02 * math.sin(90 * depth ** 0.6 + 4 * math.sin(11 * x))
    colour = mix(sky(x + ripple, HORIZON * (1 - 0.9 * depth)), (16, 58, 92), 0.35 + 0.45 * depth)
    glint = math.exp(-((x - SUN[0] + 2 * ripple) / (0.03 + 0.09 * depth)) ** 2)
    return mix(colour, (255, 196, 110), 0.75 * glint * (0.55 + 0.45 * math.sin(120 * depth ** 0.7 + 9 * x)))


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def main():
    rows = bytearray()
    for j in range(HEIGHT):
        rows.append(0)  # no PNG filter in this row
        for i in range(WIDTH):
            rows += bytes(max(0, min(255, round(c))) for c in picture((i + 0.5) / WIDTH, (j + 0.5) / HEIGHT))
    path = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "assets", "style_sunset.png")
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", WIDTH, HEIGHT, 8, 2, 0, 0, 0))
                   + chunk(b"IDAT", zlib.compress(bytes(rows), 9)) + chunk(b"IEND", b""))


if __name__ == "__main__":
    main()
