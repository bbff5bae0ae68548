#!/usr/bin/env python3
"""Opens `regrade view` of a small scene in headless Chromium, drops a picture on it, and renders an exact film.

  look_at_view.py REGRADE [--run FOLDER] [--shots FOLDER] [--chromium PROGRAM]

Checked: the opening answer says that the scene is awaited, and becomes the page; a dropped picture shows its colours at once, then its style, which the page
draws, and the folder keeps it; the exact film comes; a second tab without the token sees nothing; nothing is asked of
another host, and nothing is on the console. --run takes a folder of `regrade run` or `reconstruct` instead of a small scene, and writes
into it; the window then has 320 x 180 pixels. Exit status 1 if anything is wrong, 77 if there is no Chromium.
"""

import base64
import os
import re
import subprocess
import sys
import tempfile
import time

from browser import FEW_PIXELS, SIZES, Page, complaints, open_page, parsed, parser_of, running, status_of, wait_until
from small_run import SMALL, STYLE, call, make_capture

DROP = """(async () => {
  const bytes = Uint8Array.from(atob(%s), (c) => c.charCodeAt(0));
  await regradePage.take(new File([bytes], 'sun set.png', {type: 'image/png'}));
  const map = JSON.stringify(regradePage.state.map), time = regradePage.previewTime;
  const begun = performance.now(), put = regradePage.putStyle, shown = [];
  regradePage.putStyle = async (...style) => {
    await put(...style);
    shown.push(performance.now() - begun);
  };
  await regradePage.learned;
  regradePage.putStyle = put;
  return {map, time, shown, styles: regradePage.header.styles.length,
          weights: regradePage.weights(), after: regradePage.state.map, message: message.textContent};
})()"""

# The style as the program sent its splats, and as the page's own pass makes them: decibels between two pictures.
CODES = """(async () => {
  const p = regradePage, last = p.header.styles.length - 1, width = 96, height = 72;
  const view = {...p.view.at(width, height), width, height, weights: p.header.styles.map((_, i) => i === last ? 1 : 0)};
  const sent = await p.picture(view), before = p.colors[last];
  await p.putStyle(last, {...p.header.styles[last], weights: document.getElementById('network_' + last).textContent});
  const own = await p.picture(view), plain = await p.picture({...view, weights: view.weights.map(() => 0)});
  const decibels = (a, b) => 10 * Math.log10(255 ** 2 / Math.max(1e-9, a.reduce((sum, v, k) => sum + (v - b[k]) ** 2, 0) / (3 * width * height)));
  return [decibels(sent, own), decibels(sent, plain), before !== p.colors[last]];
})()"""

FILM = """(async () => {
  const p = regradePage, path = p.path;
  add_key.click(); p.view.turn(0.3, 0); add_key.click();
  path.keyframes[1].time = 0.25;
  const film = await p.live.film(path.text(p.header.styles.map((s) => s.id)));
  return film.size;
})()"""


def start(regrade, folder):
    """(process, address)"""
    program = subprocess.Popen([regrade, "view", folder], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                               stderr=subprocess.PIPE, text=True)
    for line in program.stderr:
        match = re.search(r"open (http://\S+)", line)
        if match:
            return program, match[1]
    raise RuntimeError("regrade view has ended")


def check_waiting(browser, address, field, away):
    """Before the scene is there the page says what it waits for; then it opens by itself."""
    page = Page(browser, address, SIZES["phone"], scale=FEW_PIXELS)
    wait_until(page, "/has no scene yet/.test(message.textContent)")
    os.rename(away, field)
    wait_until(page, "!!globalThis.regradePage?.begun")
    found = complaints(page)
    page.close()
    return found


def check_view(browser, address, folder, shots, size):
    found = []
    page = open_page(browser, address, size, scale=1 if shots else FEW_PIXELS)
    wait_until(page, "regradePage.begun && regradePage.painter.settled")
    before = page.value("regradePage.header.styles.length")
    with open(STYLE, "rb") as file:
        picture = base64.b64encode(file.read()).decode()
    page.value("regradePage.dropped_file = " + repr(picture) + "; 0")
    done = page.value(DROP % "regradePage.dropped_file")
    print(f"  colours after {done['time'] / 1000:.2f} s, the style after {', '.join(f'{t / 1000:.1f}' for t in done['shown'])} s")
    if done["map"] == "null":
        found.append("a dropped picture does not show its colours")
    if done["styles"] != before + 1 or done["weights"] != [0] * before + [1] or done["after"] is not None:
        found.append(f"the style is not shown: {done['styles']} styles, weights {done['weights']}, '{done['message']}'")
    if done["shown"] == [] or not os.path.exists(os.path.join(folder, "styles", "sun_set", "network.npz")):
        found.append("the style is not in the folder")
    own, plain, again = page.value(CODES)
    print(f"  the splats that the program styled: {own:.1f} dB from those of the page's own pass, {plain:.1f} dB from the scene")
    # As the bar between two arithmetics in page_pictures.py.
    if own < 50 or plain > 40 or not again:
        found.append("the splats that the program styled are not those of its network")
    size, film = page.value(FILM), os.path.join(folder, "films", "film.mp4")
    if not os.path.exists(film) or size != os.path.getsize(film):
        found.append("the exact film did not come")
    wait_until(page, "regradePage.painter.settled")
    if shots:
        page.shot(os.path.join(shots, "view.png"))
    found += complaints(page)
    page.close()
    outside = Page(browser, address.split("#")[0], SIZES["phone"])
    wait_until(outside, "/Open the address/.test(message.textContent)")
    if outside.value("!!document.getElementById('scene')"):
        found.append("the scene is shown without the token")
    outside.close()
    return found


def main():
    parser = parser_of(__doc__)
    parser.add_argument("regrade", help="the program")
    parser.add_argument("--run", help="an output folder, which gets a style and a film")
    arguments = parsed(parser)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
        folder = arguments.run or os.path.join(scratch, "run")
        if not arguments.run:
            capture = make_capture(arguments.regrade, os.path.join(scratch, "s"))
            status, error = call([arguments.regrade, "reconstruct", capture, "--out", folder] + SMALL)
            if status:
                raise RuntimeError(error)
        field, away = os.path.join(folder, "field.npz"), os.path.join(scratch, "field.npz")
        if not arguments.run:
            os.rename(field, away)
        program, address = start(arguments.regrade, folder)
        try:
            with running(arguments.chromium) as browser:
                found = [] if arguments.run else check_waiting(browser, address, field, away)
                found += check_view(browser, address, folder, arguments.shots, (320, 180) if arguments.run else SIZES["phone"])
        finally:
            program.terminate()
            time.sleep(0.2)
            program.wait(timeout=30)
    return status_of("look_at_view", found)


if __name__ == "__main__":
    sys.exit(main())
