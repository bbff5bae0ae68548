#!/usr/bin/env python3
"""Measures how long a scene page takes to open, to make its first style and to draw, at 320 x 180.

  page_times.py SCENE.html [--chromium PROGRAM]

Prints seconds from the beginning of the page's own script: its picture of the scene, the unpacked source, all of it drawn, the first
style; the heap after garbage collection, bytes on the graphics processor, and requests or messages, if there were any. Exit
status 77 if there is no Chromium.
"""

import sys

from browser import complaints, open_page, parsed, parser_of, running, wait_until

MARKS = """(() => {
  const marks = globalThis.marks = {};
  const look = setInterval(() => {
    const now = performance.now() / 1000, p = globalThis.regradePage;
    const mark = (name, is) => { if (is) marks[name] ??= now; };
    mark('picture', document.getElementById('poster')?.complete);
    mark('source', document.getElementById('canvas')?.className === 'ready');
    mark('drawn', p?.painter?.settled);
    mark('style', p?.begun);
    if (marks.style) clearInterval(look);
  }, 20);
})()"""


def main():
    parser = parser_of(__doc__, shots=False)
    parser.add_argument("page", help="a scene page with a style")
    arguments = parsed(parser)
    with running(arguments.chromium) as browser:
        page = open_page(browser, arguments.page, (320, 180), MARKS)
        wait_until(page, "!!marks.style && regradePage.painter.settled")
        for name, seconds in page.value("marks").items():
            print(f"{name:8} {seconds:6.2f} s")
        page.call("HeapProfiler.collectGarbage")
        heap = page.call("Runtime.getHeapUsage")
        print(f"heap     {(heap['usedSize'] + heap['embedderHeapUsedSize'] + heap['backingStorageSize']) / 1e6:6.1f} MB")
        print(f"graphics {page.value('regradePage.graphics.bytes') / 1e6:6.1f} MB")
        for complaint in complaints(page):
            print(complaint)
    return 0


if __name__ == "__main__":
    sys.exit(main())
