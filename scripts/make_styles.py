#!/usr/bin/env python3
"""Draws the style pictures of assets/: style_sunset.png (used by quickstart.sh), style_night.png and style_autumn.png.

  make_styles.py [--out FOLDER]
"""

import argparse
import math
import os
import struct
import zlib

WIDTH, HEIGHT = 256, 192
HORIZON, SUN = 0.58, (0.64, 0.47)
HILLS = ((0.50, 0.045, 9.0, 1.3), (0.54, 0.035, 15.0, 4.1))


class Light:
    """Colours of a picture: sky from top to horizon, clouds, glow around the sun, sun, hills, water, glint."""

    def __init__(self, sky, cloud, glow, sun, hills, water, glint):
        self.sky, self.cloud, self.glow, self.sun = sky, cloud, glow, sun
        self.hills, self.water, self.glint = hills, water, glint


LIGHTS = {
    "sunset": Light(((0.00, (38, 30, 92)), (0.30, (122, 48, 128)), (0.50, (226, 92, 92)), (0.72, (250, 160, 72)),
                     (1.00, (255, 226, 140))), (255, 120, 110), (255, 214, 120), (255, 247, 214),
                    ((104, 62, 116), (62, 44, 92)), (16, 58, 92), (255, 196, 110)),
    "night": Light(((0.00, (4, 8, 26)), (0.45, (10, 30, 70)), (0.80, (24, 74, 118)), (1.00, (70, 136, 160))),
                   (60, 84, 128), (150, 200, 220), (238, 246, 250), ((10, 24, 44), (4, 10, 20)), (2, 12, 34),
                   (170, 214, 230)),
    "autumn": Light(((0.00, (150, 178, 190)), (0.50, (206, 206, 186)), (1.00, (244, 226, 178))), (250, 244, 226),
                    (255, 240, 196), (255, 252, 236), ((150, 112, 52), (96, 104, 44)), (74, 98, 76), (240, 214, 150)),
}


def mix(a, b, t):
    return tuple(x + (y - x) * t for x, y in zip(a, b))


def ramp(stops, t):
    for (t0, c0), (t1, c1) in zip(stops, stops[1:]):
        if t <= t1:
            return mix(c0, c1, (t - t0) / (t1 - t0))
    return stops[-1][1]


def sky(light, x, y):
    colour = ramp(light.sky, min(1.0, y / HORIZON))
    cloud = math.sin(9 * x + 24 * y + 1.5 * math.sin(7 * x)) * math.sin(31 * y + 2 * x)
    colour = mix(colour, light.cloud, 0.35 * max(0.0, cloud) * (1 - y / HORIZON))
    distance = math.hypot((x - SUN[0]) * WIDTH / HEIGHT, y - SUN[1])
    colour = mix(colour, light.glow, 0.6 * math.exp(-(distance / 0.16) ** 2))
    return light.sun if distance < 0.055 else colour


def picture(light, x, y):
    """Colour at x, y in [0, 1], y downwards."""
    if y < HORIZON:
        colour = sky(light, x, y)
        for (base, height, frequency, phase), hill in zip(HILLS, light.hills):
            if y > base + height * math.sin(frequency * x + phase) * math.cos(3.1 * x + phase):
                colour = mix(hill, colour, 0.15)
        return colour
    depth = (y - HORIZON) / (1 - HORIZON)
    ripple = 0.02 * math.sin(90 * depth ** 0.6 + 4 * math.sin(11 * x))
    colour = mix(sky(light, x + ripple, HORIZON * (1 - 0.9 * depth)), light.water, 0.35 + 0.45 * depth)
    glint = math.exp(-((x - SUN[0] + 2 * ripple) / (0.03 + 0.09 * depth)) ** 2)
    return mix(colour, light.glint, 0.75 * glint * (0.55 + 0.45 * math.sin(120 * depth ** 0.7 + 9 * x)))


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def draw(light, path):
    rows = bytearray()
    for j in range(HEIGHT):
        rows.append(0)  # no PNG filter in this row
        for i in range(WIDTH):
            rows += bytes(max(0, min(255, round(c))) for c in picture(light, (i + 0.5) / WIDTH, (j + 0.5) / HEIGHT))
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", WIDTH, HEIGHT, 8, 2, 0, 0, 0))
                   + chunk(b"IDAT", zlib.compress(bytes(rows), 9)) + chunk(b"IEND", b""))


def main():
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", default=os.path.join(root, "assets"), help="output folder; default: assets/")
    out = parser.parse_args().out
    os.makedirs(out, exist_ok=True)
    for name, light in LIGHTS.items():
        draw(light, os.path.join(out, f"style_{name}.png"))


if __name__ == "__main__":
    main()
