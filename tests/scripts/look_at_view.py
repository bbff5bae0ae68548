#!/usr/bin/env python3
"""Opens `regrade view` of a small scene in headless Chromium, drops a picture on it, and renders an exact film.

  look_at_view.py REGRADE [--shots FOLDER] [--chromium PROGRAM]

Checked: the opening answer becomes the page; a dropped picture shows its colours at once, then its style, which the page
draws, and the folder keeps it; the exact film comes; a second tab without the token sees nothing; nothing is asked of
another host, and nothing is on the console. Exit status 1 if anything is wrong, 77 if there is no Chromium.
"""

import base64
import os
import re
import subprocess
import sys
import tempfile
import time

from browser import SIZES, Page, complaints, open_page, parsed, parser_of, running, status_of, wait_until
from small_run import SMALL, STYLE, call, make_capture

DROP = """(async () => {
  const bytes = Uint8Array.from(atob(%s), (c) => c.charCodeAt(0));
  await regradePage.take(new File([bytes], 'sun set.png', {type: 'image/png'}));
  const map = JSON.stringify(regradePage.state.map), time = regradePage.previewTime;
  const begun = performance.now();
  await regradePage.learned;
  return {map, time, learned: performance.now() - begun, styles: regradePage.header.styles.length,
          weights: regradePage.weights(), after: regradePage.state.map, message: message.textContent};
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


def check_view(browser, address, folder, shots):
    found = []
    page = open_page(browser, address, SIZES["phone"])
    with open(STYLE, "rb") as file:
        picture = base64.b64encode(file.read()).decode()
    page.value("regradePage.dropped_file = " + repr(picture) + "; 0")
    done = page.value(DROP % "regradePage.dropped_file")
    print(f"  colours after {done['time'] / 1000:.2f} s, the style after {done['learned'] / 1000:.1f} s")
    if done["map"] == "null":
        found.append("a dropped picture does not show its colours")
    if done["styles"] != 1 or done["weights"] != [1] or done["after"] is not None:
        found.append(f"the style is not shown: {done['styles']} styles, weights {done['weights']}, '{done['message']}'")
    if not os.path.exists(os.path.join(folder, "styles", "sun_set", "network.npz")):
        found.append("the style is not in the folder")
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
    arguments = parsed(parser)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
        folder = os.path.join(scratch, "run")
        status, error = call([arguments.regrade, "reconstruct", make_capture(arguments.regrade, os.path.join(scratch, "s")),
                              "--out", folder] + SMALL)
        if status:
            raise RuntimeError(error)
        program, address = start(arguments.regrade, folder)
        try:
            with running(arguments.chromium) as browser:
                found = check_view(browser, address, folder, arguments.shots)
        finally:
            program.terminate()
            time.sleep(0.2)
            program.wait(timeout=30)
    return status_of("look_at_view", found)


if __name__ == "__main__":
    sys.exit(main())
