#!/usr/bin/env python3
"""Counts texture fetches a ray of a scene page, and compares its opacity steps with its exact mode, at the photos' places.

  page_fetches.py SCENE.html [--views N] [--width W] [--chromium PROGRAM]

Prints, for the page's opacity steps while moving and at rest and without steps: fetches a ray, mean over all views, and
the worst view's decibels to the page without steps, for the source and, if there is one, the first style. Exit status 77 if
there is no Chromium.
"""

import json
import math
import sys

from browser import SIZES, open_page, parsed, parser_of, running

# One view: fetches a ray, and the mean squared difference from the picture without opacity steps.
MEASURE = """(async () => {
  const p = regradePage, photos = p.view.photos, [weights, name, place, width] = %s, height = Math.round(width * 3 / 4);
  p.view.go(photos[Math.floor(place * photos.length)]);
  const view = {...p.view.at(width, height), width, height, weights}, opacityStep = p.painter.steps[name] ?? 0;
  const counts = await p.picture({...view, opacityStep, count: true});
  let fetches = 0, error = 0;
  for (let k = 0; k < counts.length; k += 4) fetches += counts[k] + 256 * counts[k + 1];
  if (opacityStep > 0) {
    const exact = await p.picture(view), got = await p.picture({...view, opacityStep});
    for (let k = 0; k < got.length; ++k) if (k %% 4 < 3) error += (got[k] - exact[k]) ** 2;
  }
  return [fetches / (width * height), error / (3 * width * height)];
})()"""


def main():
    parser = parser_of(__doc__, shots=False)
    parser.add_argument("page", help="a scene page")
    parser.add_argument("--views", type=int, default=6, help="how many of the photos' places")
    parser.add_argument("--width", type=int, default=96, help="of a picture, pixels; 3 of its height for 4")
    arguments = parsed(parser)
    with running(arguments.chromium) as browser:
        page = open_page(browser, arguments.page, SIZES["phone"])
        styles = page.value("regradePage.header.styles.length")
        for look, weights in [("source", [0] * styles)] + [("styled", [1] + [0] * (styles - 1))] * (styles > 0):
            for name in ["exact", "rest", "moving"]:
                views = [page.value(MEASURE % json.dumps([weights, name, i / arguments.views, arguments.width]))
                         for i in range(arguments.views)]
                fetches, worst = [v[0] for v in views], max(v[1] for v in views)
                decibels = f", worst view {10 * math.log10(255 ** 2 / worst):.1f} dB" if worst > 0 else ""
                print(f"{look} {name:6}: {sum(fetches) / len(fetches):6.1f} fetches a ray, {max(fetches):6.1f} in the "
                      f"worst view{decibels}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
