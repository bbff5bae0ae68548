#!/usr/bin/env python3
"""Opens scene pages in headless Chromium and compares their pictures with the program's own.

  look_at_page.py FOLDER [--shots FOLDER] [--chromium PROGRAM]

FOLDER is write_scene_pages's: pages NAME.html with views and pixels in NAME.json. Checked of each page: its pictures, its style's bound,
nothing asked of the network, nothing on the console (a violation of the page's policy is an error there), no scrolling
sideways at the sizes of a phone and a desktop, where words and the first view are in the window, names; of some, that it opens styled, that a coarse picture comes first and that workers aren't needed; of one, that keys and
the slider change the picture. Everything
that keys can do is walk_page.py's, long use and damage strain_page.py's.
--shots keeps pictures of the pages. Exit status 1 if anything is wrong, 77 if there is no Chromium.
"""

import base64
import glob
import json
import os
import sys

from browser import FEW_PIXELS, SIZES, complaints, open_page, parsed, parser_of, running, status_of, wait_until
from page_network import check_bound
from page_opening import check_coarse_first, check_without_workers
from page_pictures import compare_pictures


def check_controls(page, width):
    found = []
    wide = page.value("document.documentElement.scrollWidth")
    if wide > width:
        found.append(f"scrolls sideways: {wide} pixels wide at {width}")
    outside = page.value("[...document.querySelectorAll('#tools button,#styles input')].filter(e => { const r = "
                         "e.getBoundingClientRect(); return r.width && (r.left < 0 || r.right > innerWidth + 1 || "
                         "r.top < 0 || r.bottom > innerHeight + 1) }).length")
    if outside:
        found.append(f"{outside} controls are outside the window")
    return found


def check_places(page, size):
    """Words leave the scene's middle free, and in a window narrower than the photo all of the photo's width is seen at home."""
    found = []
    page.value("globalThis.said = message.textContent; message.textContent = 'A sentence of several words. '.repeat(3); "
               "cancel.hidden = false; 0")
    for id in ["message", "cancel"]:
        box = page.value("(() => { const r = %s.getBoundingClientRect(); return [r.left, r.top, r.right, r.bottom] })()" % id)
        middle = [0.25 * size[0], 0.25 * size[1], 0.75 * size[0], 0.75 * size[1]]
        if box[0] < middle[2] and box[2] > middle[0] and box[1] < middle[3] and box[3] > middle[1]:
            found.append(f"{id} covers the scene's middle: {[round(v) for v in box]} of {size}")
        if not (0 <= box[0] < box[2] <= size[0] and 0 <= box[1] < box[3] <= size[1]):
            found.append(f"{id} is not in the window: {[round(v) for v in box]} of {size}")
    page.value("message.textContent = said; cancel.hidden = true; home.click(); 0")
    # Half the width over the focal length: the tangent of what is seen to each side.
    seen, photo, high = page.value("(() => { const {painter, view} = regradePage, {width, height} = painter.full, {lens} = "
                                   "painter.pictureOf(width, height).view; return [width / 2 / lens[0], view.half[0], "
                                   "height / 2 / lens[1] / view.half[1]] })()")
    narrow = size[0] / size[1] < photo / page.value("regradePage.view.half[1]")
    if narrow and abs(seen / photo - 1) > 1e-9 or not narrow and not (seen >= photo and high < 1):
        found.append(f"a window of {size} shows {seen / photo:.3f} of the photo's width and {high:.3f} of its height")
    return found


def check_names(page):
    """The owner's page says what styles and photos are called."""
    said = page.value("[styles.textContent.includes('evening'), photos.querySelector('button').ariaLabel.endsWith('left.jpg')]")
    return [] if all(said) else ["the page does not name its style and its photos"]


def check_input(page):
    """Keys move the view, the slider mixes, and the view stays within its fence."""
    found = []
    where = "JSON.stringify([regradePage.view.eye, regradePage.view.forward])"
    for key in ["ArrowRight", "w", "d", "+"]:
        before = page.value(where)
        page.call("Input.dispatchKeyEvent", type="keyDown", key=key)
        try:
            wait_until(page, f"{where} !== {json.dumps(before)}")
        except RuntimeError:
            found.append(f"the key {key} does not move the view")
        page.call("Input.dispatchKeyEvent", type="keyUp", key=key)
        wait_until(page, "regradePage.painter.changed === false")
    page.call("Input.dispatchKeyEvent", type="keyDown", key="h")
    page.call("Input.dispatchKeyEvent", type="keyUp", key="h")
    page.value("style0.value = 25; style0.dispatchEvent(new Event('input'))")
    if page.value("regradePage.weights()[0]") != 0.25:
        found.append("the slider does not set the style's weight")
    away = page.value("(() => { for (let i = 0; i < 99; ++i) regradePage.view.move(9, 0, 9); return "
                      "regradePage.view.eye.every((v, a) => v >= regradePage.view.fence[0][a] && v <= "
                      "regradePage.view.fence[1][a]) })()")
    if not away:
        found.append("the view leaves its fence")
    path = page.value("(() => { add_key.click(); home.click(); add_key.click(); const t = regradePage.path.text(['a']);"
                      "regradePage.path.read(t, ['a']); return regradePage.path.text(['a']) === t && "
                      "regradePage.path.keyframes.length === 2 })()")
    if not path:
        found.append("a camera path does not come back from its text")
    return found


def check_path(page, folder):
    """Places, directions, angles and weights along a camera path are those of the program, to rounding."""
    with open(os.path.join(folder, "camera_path.json"), encoding="utf-8") as file:
        text = file.read()
    with open(os.path.join(folder, "places.json"), encoding="utf-8") as file:
        want = json.load(file)
    got = page.value("(() => { const path = regradePage.path, view = regradePage.view, kept = path.keyframes; path.read(" +
                     json.dumps(text) + ", ['a', 'b']); const all = " + json.dumps([row[0] for row in want]) +
                     ".map((t) => { const k = path.at(t), to = Object.create(view); Object.assign(to, {eye: k.eye, "
                     "forward: k.forward, top: k.up, half: k.half}); const at = to.at(48, 36), r = at.rotation; return [t, "
                     "...k.eye, ...k.forward, ...k.up, ...k.half, ...k.weights, at.lens[0], r[0], r[3], r[6], r[1], r[4], "
                     "r[7], r[2], r[5], r[8]] }); path.keyframes = kept; return all })()")
    worst = max(abs(a - b) for one, two in zip(got, want) for a, b in zip(one, two))
    print(f"  camera path: {len(want)} moments, {len(want[0])} numbers each, worst difference {worst:.1e}")
    # Numbers of about 1, focal lengths of about 50 pixels: sums of a few terms in double precision.
    return [] if len(got) == len(want) and worst < 1e-12 else [f"a camera path differs from the program's by {worst}"]


def check_colors(page, folder):
    """The maps of colours are the program's, and a dropped picture gets one at once."""
    found = []
    with open(os.path.join(folder, "colors.json"), encoding="utf-8") as file:
        rows = json.load(file)
    got = page.value("regradePage.colorMaps(" + json.dumps([row[:2] for row in rows]) + ")")
    scale = [max(1, *map(abs, row[2])) for row in rows]
    worst = max(abs(a - b) / s for one, row, s in zip(got, rows, scale) for a, b in zip(one, row[2]))
    print(f"  colour maps: {len(rows)}, worst difference {worst:.1e} of the largest number")
    # The page squares the inner root: half of the digits of double precision.
    if worst > 1e-7:
        found.append(f"a map of colours differs from the program's by {worst}")
    page.value("(async () => { const c = document.createElement('canvas'); c.width = 320; c.height = 180; const x = "
               "c.getContext('2d'); for (let i = 0; i < 64; ++i) { x.fillStyle = `hsl(${i * 37} 80% ${20 + i % 50}%)`; "
               "x.fillRect(i * 5, 0, 5, 180) } const b = await new Promise(d => c.toBlob(d)); "
               "await regradePage.take(new File([b], 'a.png')) })()")
    before = page.value("JSON.stringify(regradePage.state.map)")
    seconds = page.value("regradePage.previewTime") / 1000
    print(f"  dropped picture: its colours after {seconds:.2f} s")
    if before == "null" or page.value("dropped.hidden"):
        found.append("a dropped picture changes nothing")
    page.value("dropped_part.value = 0; dropped_part.dispatchEvent(new Event('input'))")
    none = page.value("regradePage.state.map.matrix.map((v, i) => Math.abs(v - (i % 4 === 0))).reduce((a, b) => a + b)")
    page.value("remove_picture.click()")
    if none != 0 or page.value("regradePage.state.map !== null || !dropped.hidden"):
        found.append("the picture's slider does not lead back to the scene")
    page.value("regradePage.take(new File(['no picture'], 'a.txt'))")
    if "cannot open this picture" not in page.value("message.textContent"):
        found.append("a file that is no picture is taken for one")
    return found


# Decodes every frame of the film with the browser's decoder, and compares it with the page's own pixels.
FILM = """(async () => {
  const p = regradePage, path = p.path, kept = path.keyframes;
  path.read(%s, ['a', 'b']);
  path.keyframes = path.keyframes.slice(0, 2);
  path.keyframes.forEach((k, i) => { k.time = 0.25 * i; k.weights = [i]; });
  film_size.value = 160;
  const made = await p.film(), data = new DataView(await made.film.arrayBuffer()), bytes = new Uint8Array(data.buffer);
  const find = (name) => { for (let i = 0; i < bytes.length - 4; ++i) if ([...name].every((c, k) => bytes[i + k] === c.charCodeAt(0))) return i + 4 };
  const sizes = find('stsz') + 8, count = data.getUint32(sizes), offset = data.getUint32(find('stco') + 8), setup = find('avcC');
  let at = offset, worst = 99, frames = 0;
  const out = [], decoder = new VideoDecoder({output: (f) => out.push(f), error: (e) => { throw e }});
  decoder.configure({codec: made.codec, codedWidth: made.width, codedHeight: made.height,
    ...(setup ? {description: bytes.slice(setup, setup + data.getUint32(setup - 8) - 8)} : {})});
  for (let i = 0; i < count; ++i) {
    const size = data.getUint32(sizes + 4 + 4 * i);
    decoder.decode(new EncodedVideoChunk({type: i === 0 ? 'key' : 'delta', timestamp: i, data: bytes.slice(at, at + size)}));
    at += size;
  }
  await decoder.flush();
  for (const frame of out) {
    const w = made.width, h = made.height, rgba = new Uint8Array(4 * w * h);
    await frame.copyTo(rgba, {format: 'RGBA'});
    const own = await p.moment(path.at(path.seconds * frames / (count - 1)), w, h);
    let sum = 0;
    for (let y = 0; y < h; ++y) for (let x = 0; x < w; ++x) for (let c = 0; c < 3; ++c)
      sum += (rgba[4 * (y * w + x) + c] - own[4 * ((h - 1 - y) * w + x) + c]) ** 2;
    worst = Math.min(worst, 10 * Math.log10(255 ** 2 * 3 * w * h / Math.max(sum, 1e-9)));
    frame.close();
    ++frames;
  }
  path.keyframes = kept;
  let text = '';
  for (const b of bytes) text += String.fromCharCode(b);
  return {codec: made.codec, count: made.count, frames, ends: at === bytes.length, worst, width: made.width, data: btoa(text)};
})()"""


def check_film(page, folder, shots):
    if not page.value("typeof VideoEncoder !== 'undefined'"):
        return []
    with open(os.path.join(folder, "camera_path.json"), encoding="utf-8") as file:
        film = page.value(FILM % json.dumps(file.read()))
    print(f"  film: {film['codec']}, {film['frames']} of {film['count']} frames, worst {film['worst']:.1f} dB from the page")
    if shots:
        with open(os.path.join(shots, "film.mp4"), "wb") as out:
            out.write(base64.b64decode(film["data"]))
    # A quarter of a second at 24 a second.
    if film["count"] != 6 or film["frames"] != 6 or not film["ends"] or film["width"] != 160:
        return [f"the film has {film['frames']} frames of {film['count']}"]
    # 4:2:0 and the encoder: what a person takes for the same picture.
    return [] if film["worst"] >= 35 else [f"a frame of the film is {film['worst']:.1f} dB from the page"]


def check_graphics(browser, path, views):
    """Styles made on the graphics processor, as where it is no program on the cores."""
    page = open_page(browser, path, SIZES["phone"], scale=FEW_PIXELS)
    page.value("location.hash = '#graphics'")
    page.reload()
    wait_until(page, "!!globalThis.regradePage && !!regradePage.picture")
    found = compare_pictures(page, [view for view in views if view["weights"][0] == 1]) + complaints(page)
    page.close()
    return ["styled on the graphics processor: " + complaint for complaint in found]


def check_folder(browser, arguments):
    found = []
    for path in sorted(glob.glob(os.path.join(arguments.folder, "*.html"))):
        name = os.path.basename(path)[:-5]
        print(name)
        with open(path[:-5] + ".json", encoding="utf-8") as file:
            views = json.load(file)
        splats = name == "splats"  # what hangs on no field is checked there
        for size_name, size in SIZES.items() if splats else [("phone", SIZES["phone"])]:
            page = open_page(browser, path, size, scale=1 if arguments.shots else FEW_PIXELS)
            here = check_controls(page, size[0]) + check_places(page, size) + check_names(page)
            if size_name == "phone":
                here += compare_pictures(page, views) + check_bound(page)
            else:
                here += check_input(page) + check_path(page, arguments.folder)
                here += check_colors(page, arguments.folder) + check_film(page, arguments.folder, arguments.shots)
            if arguments.shots:
                wait_until(page, "regradePage.painter.settled")
                page.shot(os.path.join(arguments.shots, f"{name}_{size_name}.png"))
            here += complaints(page)
            found += [f"{name}, {size_name}: {complaint}" for complaint in here]
            page.close()
        if name in ("object", "splats"):
            found += [f"{name}, opening: {c}" for c in check_coarse_first(browser, path) + check_without_workers(browser, path, views, splats)]
        if splats:
            found += [f"{name}, {c}" for c in check_graphics(browser, path, views)]
    return found


def main():
    parser = parser_of(__doc__)
    parser.add_argument("folder", help="folder with pages and their views")
    arguments = parsed(parser)
    if not glob.glob(os.path.join(arguments.folder, "*.html")):
        parser.error(arguments.folder + " has no pages")
    with running(arguments.chromium) as browser:
        found = check_folder(browser, arguments)
    return status_of("look_at_page", found)


if __name__ == "__main__":
    sys.exit(main())
