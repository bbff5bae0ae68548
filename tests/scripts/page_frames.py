#!/usr/bin/env python3
"""Times a scene page's frames at 1280 x 720 on a graphics processor, without a window and without a browser.

  page_frames.py pack SCENE.html FOLDER [--views N] [--chromium PROGRAM]
  page_frames.py time FOLDER [--out FILE.json] [--frames N] [--size WxH] [--modes LIST] [--compute] [--device N]

`pack` opens the page in headless Chromium and writes its shader, its textures and what it draws with at the photos' places,
with a copy of this script: FOLDER alone is enough for `time`, on any machine with Python 3 and a driver. `time` draws with
OpenGL ES 3 through EGL, compares a small picture with the browser's, counts fetches, and prints and writes, for the page's
modes moving and rest (modes: moving, rest, exact): milliseconds a frame with a glFinish after each, median and 95th
percentile, and the same without waiting between frames. --compute runs the same shader as a compute shader (OpenGL ES 3.1),
for cards most of whose processors cannot run fragment shaders.

gles.py says which libraries and displays are tried; --device picks one of EGL_EXT_device_enumeration.
Exit status 1 if a picture differs, 77 if there is no Chromium or no EGL.
"""

import argparse
import shutil
import sys


def pack(arguments):
    if not arguments.chromium:
        print("Chromium is not installed (Debian package chromium)")
        return 77
    from page_pack import pack as write
    return write(arguments)


def time_frames(arguments):
    from page_frame_times import time_frames as measure
    return measure(arguments)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    packing = commands.add_parser("pack")
    packing.add_argument("page")
    packing.add_argument("folder")
    packing.add_argument("--views", type=int, default=6)
    packing.add_argument("--chromium", default=shutil.which("chromium") or shutil.which("chromium-browser"))
    packing.set_defaults(do=pack)
    timing = commands.add_parser("time")
    timing.add_argument("folder")
    timing.add_argument("--out")
    timing.add_argument("--frames", type=int, default=120, help="of each mode, over all views")
    timing.add_argument("--size", default="1280x720")
    timing.add_argument("--modes", default="moving,rest")
    timing.add_argument("--compute", action="store_true")
    timing.add_argument("--device", type=int)
    timing.set_defaults(do=time_frames)
    arguments = parser.parse_args()
    return arguments.do(arguments)


if __name__ == "__main__":
    sys.exit(main())
