#!/usr/bin/env python3
"""Measures how long a scene page takes to show its scene and its styles, at 320 x 180, and what it takes up.

  page_times.py SCENE.html [--size WxH] [--without-workers] [--chromium PROGRAM]

Prints seconds from the beginning of the navigation: the picture in the file, the coarse scene drawn, the whole scene drawn as
while moving and at rest, both with the first style; of each other style from its beginning; the longest pause of the page's own thread
until the whole scene is drawn; bytes on the graphics processor, now and at most; the heap after garbage collection and the
page's bytes; requests, and violations of the page's policy or other messages; and the machine's load. --without-workers
takes the workers away, as some browsers do for a file. Exit status 1 for requests, messages or a heap of 3 pages, 77 if
there is no Chromium.
"""

import os
import sys

from browser import complaints, open_page, parsed, parser_of, running, wait_until
from page_opening import NO_WORKERS

MARKS = """(() => {
  const marks = globalThis.marks = {pause: 0};
  let before = performance.now();
  const look = () => {
    const now = performance.now(), p = globalThis.regradePage, shown = p?.painter?.shown;
    if (!marks.whole) marks.pause = Math.max(marks.pause, (now - before) / 1000);
    before = now;
    const mark = (name, is) => { if (is) marks[name] ??= now / 1000; };
    mark('picture', document.getElementById('poster')?.complete);
    mark('coarse', shown);
    mark('whole', shown && !shown.coarse);
    mark('at rest', marks.whole && p.painter.settled);
    if (!p?.begun || !marks['at rest']) setTimeout(look, 5);
  };
  look();
})();"""

# Seconds until the canvas shows a further style.
STYLE = """(async () => {
  const p = regradePage, i = %d, begun = performance.now();
  p.state.axes = [i, 0];
  p.state.amount = [1, 0];
  await p.load(i);
  p.changed();
  while (p.painter.changed) await new Promise((done) => setTimeout(done, 5));
  return (performance.now() - begun) / 1000;
})()"""

HEAP_PAGES = 3


def measure(page, file):
    found = []
    wait_until(page, "!!marks.whole && regradePage.begun && regradePage.painter.settled && message.textContent === ''", 1200)
    marks = page.value("marks")
    pause = marks.pop("pause")
    for name in ["picture", "coarse", "whole", "at rest"]:
        print(f"{name:8} {marks.get(name, float('nan')):7.2f} s")
    print(f"pause    {pause:7.2f} s at the longest, until the whole scene is drawn")
    print(f"graphics {page.value('regradePage.graphics.bytes') / 1e6:7.1f} MB, at most {page.value('regradePage.graphics.most') / 1e6:.1f}, with "
          f"{page.value('regradePage.colors.filter(Boolean).length')} styles")
    for i in range(1, page.value("regradePage.header.styles.length")):
        print(f"style {i + 1}  {page.value(STYLE % i):7.2f} s")
        print(f"graphics {page.value('regradePage.graphics.bytes') / 1e6:7.1f} MB, at most {page.value('regradePage.graphics.most') / 1e6:.1f}, "
              f"with {i + 1} styles")
    page.call("HeapProfiler.collectGarbage")
    heap = page.call("Runtime.getHeapUsage")
    heap = heap["usedSize"] + heap["embedderHeapUsedSize"] + heap["backingStorageSize"]
    size = os.path.getsize(file)
    print(f"heap     {heap / 1e6:7.1f} MB, {heap / size:.2f} of the page's {size / 1e6:.1f} MB")
    if heap > HEAP_PAGES * size:
        found.append("the heap is too large")
    said = complaints(page)
    print(f"requests {sum(c.startswith('requests') for c in said):4}, violations {sum('Content Security Policy' in c for c in said)}")
    return found + said


def main():
    parser = parser_of(__doc__, shots=False)
    parser.add_argument("page", help="a scene page")
    parser.add_argument("--size", default="320x180", help="of the window")
    parser.add_argument("--without-workers", action="store_true")
    arguments = parsed(parser)
    size = tuple(map(int, arguments.size.split("x")))
    print("load     " + " ".join(f"{x:.1f}" for x in os.getloadavg()))
    with running(arguments.chromium) as browser:
        page = open_page(browser, arguments.page, size, MARKS + (NO_WORKERS if arguments.without_workers else ""), seconds=1200)
        found = measure(page, arguments.page)
    print("load     " + " ".join(f"{x:.1f}" for x in os.getloadavg()))
    for complaint in found:
        print(complaint)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
