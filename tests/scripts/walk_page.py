#!/usr/bin/env python3
"""Uses a scene page by keyboard alone, and checks what it tells somebody who does not see it.

  walk_page.py SCENE.html [--axe axe.min.js] [--shots FOLDER] [--chromium PROGRAM]

With three styles, a camera path, a dropped picture and the split view, at the sizes of a phone (light) and a desktop (dark):
Tab reaches every control and leaves the page, and back; the ring around the focus is seen; each control does its work by
keys, and the focus is not lost; every control in Chromium's accessibility tree has a role and a name of its own, and
every slider a value in words; text has a contrast of 4.5 over any picture; the page has a language and a title.
--axe also runs axe-core, which is not part of the project (npm install axe-core), and prints what it finds.
Exit status 1 if anything is wrong, 77 if there is no Chromium.
"""

import json
import os
import sys

from browser import FEW_PIXELS, SIZES, complaints, open_page, parsed, parser_of, running, status_of, wait_until

KEYS = {"Tab": 9, "Enter": 13, " ": 32, "Escape": 27, "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40}
TEXT = {"Enter": "\r", " ": " "}
# Rings around the focus are seen in whole pixels of the window; the canvas has few of its own.
FEW_OF_CANVAS = f"Object.defineProperty(window, 'devicePixelRatio', {{get: () => {FEW_PIXELS}}})"
TEXT_CONTRAST = 4.5  # WCAG 2.2, 1.4.3
RING_CONTRAST = 3  # WCAG 2.2, 1.4.11

# Everything that can be operated, with what says that it was.
SETUP = """(async () => {
  const p = regradePage, style = {...p.header.styles[0], residual: null, weights: network_0.textContent};
  await p.putStyle(1, {...style, name: 'noon'});
  await p.putStyle(2, {...style, name: 'night'});
  const c = document.createElement('canvas'), x = c.getContext('2d');
  c.width = c.height = 64;
  x.fillStyle = '#a60'; x.fillRect(0, 0, 40, 64);
  await p.take(new File([await new Promise((done) => c.toBlob(done))], 'a.png'));
  halve.click();
  show_path.click();
  add_key.click(); home.click(); add_key.click(); add_key.click();
})()"""

# What is focused: a name that stays the same for the same control.
FOCUSED = """(() => {
  const e = document.activeElement;
  if (!e || e === document.body) return '';
  return e.id || [...document.querySelectorAll('button,input,select')].indexOf(e) + ' ' + (e.ariaLabel || e.textContent);
})()"""

# The same names of all controls that are shown and not disabled.
WANTED = """(() => {
  const all = [...document.querySelectorAll('button,input,select')];
  return [...all, canvas].filter((e) => !e.disabled && e.getClientRects().length).map((e) =>
    e.id || all.indexOf(e) + ' ' + (e.ariaLabel || e.textContent));
})()"""

# Texts of too little contrast, over a black and over a white picture.
CONTRAST = """(() => {
  const channels = (text) => {
    const [r, g, b, a = 1] = text.match(/[\\d.]+/g).map(Number);
    return [r, g, b, a];
  };
  const over = (top, under) => [0, 1, 2].map((c) => top[3] * top[c] + (1 - top[3]) * under[c]);
  const light = (c) => c.map((v) => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, i) => sum + [0.2126, 0.7152, 0.0722][i] * v, 0);
  const ratio = (a, b) => (Math.max(light(a), light(b)) + 0.05) / (Math.min(light(a), light(b)) + 0.05);
  const found = [];
  let least = 99, texts = 0;
  for (const e of document.querySelectorAll('main *')) {
    const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim()) || e.matches('input[type=number]');
    if (!own || !e.getClientRects().length || e.disabled || e.closest('select') !== null && e.tagName === 'OPTION') continue;
    ++texts;
    for (const picture of [0, 255]) {
      const chain = [];
      for (let at = e; at && at.tagName !== 'MAIN'; at = at.parentElement) chain.unshift(at);
      const behind = chain.reduce((under, at) => over(channels(getComputedStyle(at).backgroundColor), under), [picture, picture, picture]);
      const own = ratio(over(channels(getComputedStyle(e).color), behind), behind);
      least = Math.min(least, own);
      if (own < LEAST) found.push(`${e.tagName} "${e.textContent.trim().slice(0, 30)}" has a contrast of ${own.toFixed(2)}`);
    }
  }
  return {found, least, texts};
})()""".replace("LEAST", str(TEXT_CONTRAST))

# Of two screenshots, the number of pixels that differ by the contrast of a thing one must see.
RING = """(async () => {
  const pixels = async (text) => {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const picture = await createImageBitmap(new Blob([bytes])), c = new OffscreenCanvas(picture.width, picture.height);
    c.getContext('2d').drawImage(picture, 0, 0);
    return c.getContext('2d').getImageData(0, 0, picture.width, picture.height).data;
  };
  const light = (d, i) => [0.2126, 0.7152, 0.0722].reduce((sum, w, c) => {
    const v = d[i + c] / 255;
    return sum + w * (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
  }, 0.05);
  const [a, b] = [await pixels(%s), await pixels(%s)];
  let changed = 0;
  for (let i = 0; i < a.length; i += 4) {
    const x = light(a, i), y = light(b, i);
    changed += Math.max(x, y) / Math.min(x, y) >= CONTRAST;
  }
  return changed;
})()""".replace("CONTRAST", str(RING_CONTRAST))


def press(page, key, shift=False, hold=False):
    more = {"key": key, "code": "Space" if key == " " else key, "windowsVirtualKeyCode": KEYS.get(key, ord(key[0].upper())),
            "modifiers": 8 if shift else 0}
    text = TEXT.get(key, key if len(key) == 1 else "")
    page.call("Input.dispatchKeyEvent", type="keyDown", **more, **({"text": text} if text else {}))
    if not hold:
        page.call("Input.dispatchKeyEvent", type="keyUp", **more)


def release(page, key):
    page.call("Input.dispatchKeyEvent", type="keyUp", key=key, code="Space" if key == " " else key,
              windowsVirtualKeyCode=KEYS.get(key, ord(key[0].upper())))


def shot_around(page, box):
    clip = {"x": max(0, box[0] - 8), "y": max(0, box[1] - 8), "width": box[2] + 16, "height": box[3] + 16, "scale": 1}
    return page.call("Page.captureScreenshot", format="png", clip=clip)["data"]


def check_ring(page, name):
    """A ring of at least one pixel's width is seen around what has the focus."""
    box = page.value("(() => { const e = document.activeElement, r = (e.type === 'file' ? e.parentElement : e)"
                     ".getBoundingClientRect(); return [r.x, r.y, r.width, r.height] })()")
    focused = shot_around(page, box)
    page.value("globalThis.kept = document.activeElement; kept.blur()")
    bare = shot_around(page, box)
    page.value("kept.focus({focusVisible: true})")
    changed = page.value(RING % (json.dumps(focused), json.dumps(bare)))
    inside = page.value("(() => { const [x, y, w, h] = %s; return x >= 0 && y >= 0 && x + w <= innerWidth + 1 && "
                        "y + h <= innerHeight + 1 })()" % json.dumps(box))
    found = [] if inside else [f"{name} has the focus outside of the window, at {[round(v) for v in box]}"]
    least = 2 * (box[2] + box[3])
    if changed < least:
        found.append(f"the focus on {name} is not seen: {changed} pixels of contrast {RING_CONTRAST}, {least:.0f} expected")
    return found


def check_tab(page):
    """Tab reaches every control once, in order, and leaves; Shift and Tab reach the same ones."""
    found, wanted = [], page.value(WANTED)
    page.value("document.activeElement.blur(); 0")
    orders = []
    for shift in [False, True]:
        order = []
        for _ in range(len(wanted) + 8):
            press(page, "Tab", shift)
            now = page.value(FOCUSED)
            if not now or now in order:
                break
            order.append(now)
            if not shift:
                found += check_ring(page, now)
        orders.append(order)
        page.value("document.activeElement.blur(); 0")
    missing = sorted(set(wanted) - set(orders[0]))
    if missing:
        found.append(f"Tab does not reach {missing}")
    if sorted(orders[0]) != sorted(orders[1]):
        found.append(f"Shift and Tab reach other controls: {sorted(set(orders[0]) ^ set(orders[1]))}")
    print(f"  Tab: {len(orders[0])} of {len(wanted)} controls")
    return found


def has(page, what, expected, doing):
    try:
        wait_until(page, expected)
        return [] if page.value("document.activeElement !== document.body") else [f"{what}: {doing} loses the focus"]
    except RuntimeError:
        return [f"{what}: {doing} does nothing"]


def check_work(page):
    """Every kind of control does its work by keys alone."""
    found = []
    focus = "document.querySelector(%s).focus({focusVisible: true}); 0"

    def at(selector, key, expected, before=None):
        page.value(focus % json.dumps(selector))
        if before:
            page.value(before)
        press(page, key)
        found.extend(has(page, selector, expected, "Space" if key == " " else key))

    at("#mode", " ", "mode.ariaPressed === 'true' && regradePage.view.mode === 'fly'")
    at("#mode", "Enter", "mode.ariaPressed === 'false' && regradePage.view.mode === 'orbit'")
    at("#halve", " ", "!regradePage.state.split && half.hidden")
    at("#halve", " ", "regradePage.state.split && !half.hidden")
    at("#home", "Enter", "regradePage.view.eye.every((v, i) => v === globalThis.eye[i])",
       "globalThis.eye = regradePage.view.photos[regradePage.header.home].eye; regradePage.view.move(0.2, 0.1, 0); 0")
    at("#photos button:nth-child(2)", "Enter",
       "regradePage.view.eye.join() === regradePage.view.photos[regradePage.header.photos[1].camera].eye.join()")
    page.value(focus % '"#compare"')
    for key in [" ", "Enter"]:
        press(page, key, hold=True)
        found += has(page, "compare", "regradePage.state.original", "a held key")
        release(page, key)
        found += has(page, "compare", "!regradePage.state.original", "letting go of a key")
    for slider in ["#style0", "#style1", "#dropped_part", "#cut"]:
        at(slider, "ArrowRight", f"document.querySelector('{slider}').value === '31' && "
           f"/^31 %/.test(document.querySelector('{slider}').ariaValueText)",
           f"document.querySelector('{slider}').value = 30; 0")
    at("#styles select", "ArrowDown", "regradePage.state.axes[0] === 1")
    at("#film_size", "ArrowUp", "film_size.value === '1281'", "film_size.value = 1280; 0")
    at("#add_key", " ", "regradePage.path.keyframes.length === 4")
    at("#keyframes li:nth-child(2) input", "ArrowUp", "regradePage.path.keyframes[1].time > globalThis.time",
       "globalThis.time = regradePage.path.keyframes[1].time; 0")
    at("#keyframes li:nth-child(2) button", "Enter",
       "regradePage.view.eye.join() === regradePage.path.keyframes[1].eye.join()", "regradePage.view.move(0.2, 0, 0); 0")
    for left in [3, 2, 1, 0]:
        at("#keyframes li:last-child button:last-child", " ", f"regradePage.path.keyframes.length === {left}")
    at("#add_key", "Enter", "regradePage.path.keyframes.length === 1")
    at("#add_key", "Enter", "!play.disabled")
    at("#play", " ", "regradePage.state.playing !== null && play.textContent === 'Stop'")
    at("#play", " ", "regradePage.state.playing === null")
    at("#save_film", "Enter", "!cancel.hidden", "film_size.value = 64; regradePage.path.keyframes[1].time = 60; 0")
    at("#cancel", " ", "cancel.hidden")
    at("#film_fps", "Escape", "path.hidden && document.activeElement === show_path")
    at("#show_facts", " ", "!facts.hidden && show_facts.ariaExpanded === 'true' && facts.textContent.includes('Splats')")
    at("#show_facts", " ", "facts.hidden && show_facts.ariaExpanded === 'false'")
    at("#show_help", "Enter", "!help.hidden && show_help.ariaExpanded === 'true' && document.activeElement === help")
    found.extend(check_contrast(page))
    press(page, "Escape")
    found.extend(has(page, "the controls", "help.hidden && document.activeElement === show_help", "Escape"))
    press(page, "?")
    found.extend(has(page, "the controls", "document.activeElement === help && /W A S D/.test(help.textContent)", "?"))
    press(page, "?")
    found.extend(has(page, "the controls", "help.hidden && show_help.ariaExpanded === 'false'", "? again"))
    at("#remove_picture", " ", "dropped.hidden")
    page.call("Page.setInterceptFileChooserDialog", enabled=True)
    for place, sheet in [("#open_picture", None), ("#open_path", "show_path.click()")]:
        page.value((sheet or "0") + "; 0")
        page.value(focus % json.dumps(place))
        page.browser.events = [e for e in page.browser.events if e.get("method") != "Page.fileChooserOpened"]
        press(page, "Enter")
        try:
            page.browser.wait_for("Page.fileChooserOpened")
        except RuntimeError:
            found.append(place + ": Enter opens no file")
    return found


def check_canvas(page):
    """Keys move the view where the canvas has the focus."""
    found = []
    page.value("canvas.focus({focusVisible: true}); home.onclick(); 0")
    for key in ["ArrowLeft", "ArrowUp", "w", "a", "s", "d", "q", "e", "+", "-"]:
        page.value("globalThis.seen = JSON.stringify(regradePage.view.save()); 0")
        press(page, key, hold=True)
        found += has(page, "the view", "JSON.stringify(regradePage.view.save()) !== globalThis.seen", key)
        release(page, key)
    return found


def check_tree(page):
    """Roles, names and values as Chromium tells a screen reader."""
    found, names = [], {}
    page.call("Accessibility.enable")
    nodes = [n for n in page.call("Accessibility.getFullAXTree")["nodes"] if not n.get("ignored")]
    page.call("Accessibility.disable")
    for node in nodes:
        role, name = node.get("role", {}).get("value"), node.get("name", {}).get("value", "").strip()
        own = {p["name"]: p["value"].get("value") for p in node.get("properties", [])}
        if role == "RootWebArea":
            names["page"] = name
            continue
        if role in ("image", "img") and not name:
            found.append("a picture has no name")
        if not own.get("focusable") or role in ("option", "MenuListOption"):
            continue
        if role in (None, "generic", "none"):
            found.append(f"'{name}' can be focused and has no role")
        if not name:
            found.append(f"a control of the role {role} has no name")
        elif (role, name) in names:
            found.append(f"two controls are called {name}")
        names[role, name] = 1
        if role == "slider" and node.get("value", {}).get("value") is None:
            found.append(f"the slider {name} has no value")
    # The protocol gives a slider's number only.
    silent = page.value("[...document.querySelectorAll('input[type=range]')].filter((e) => e.getClientRects().length && "
                        "!(e.ariaValueText ?? '').startsWith(e.value + ' %')).map((e) => e.id)")
    if silent:
        found.append(f"sliders do not say their values in words: {silent}")
    if not names.get("page"):
        found.append("the page has no title")
    if not page.value("/^[a-z]{2}/.test(document.documentElement.lang)"):
        found.append("the page has no language")
    print(f"  accessibility tree: {len(names) - 1} controls, {sum(role == 'slider' for role, *_ in names if role != 'page')} sliders")
    return found


def check_contrast(page):
    got = page.value(CONTRAST)
    print(f"  contrast of {got['texts']} texts: at least {got['least']:.2f}")
    return got["found"] if got["texts"] > 10 else ["no texts were found"]


def check_axe(page, file):
    with open(file, encoding="utf-8") as source:
        page.value(source.read() + ";0")
    rules = json.loads(page.value("axe.run(document).then((r) => JSON.stringify(r.violations.map((v) => "
                                  "[v.impact, v.id, v.nodes.map((n) => n.html.slice(0, 100))])))"))
    print(f"  axe-core {page.value('axe.version')}: {len(rules)} rules broken")
    return [f"axe-core, {impact}: {rule} {nodes}" for impact, rule, nodes in rules]


def main():
    parser = parser_of(__doc__)
    parser.add_argument("page", help="a page of splats with a style")
    parser.add_argument("--axe", help="axe-core's axe.min.js")
    arguments = parsed(parser)
    found = []
    with running(arguments.chromium) as browser:
        for size_name, scheme in [("phone", "light"), ("desktop", "dark")]:
            print(f"{size_name}, {scheme}")
            page = open_page(browser, arguments.page, SIZES[size_name], before=FEW_OF_CANVAS)
            page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
            page.value(SETUP)
            wait_until(page, "regradePage.painter.settled && message.textContent === ''")
            here = check_contrast(page) + check_tree(page) + check_tab(page)
            if arguments.axe:
                here += check_axe(page, arguments.axe)
            if arguments.shots:
                page.shot(os.path.join(arguments.shots, f"walk_{size_name}_{scheme}.png"))
            if size_name == "desktop":
                here += check_work(page) + check_canvas(page)
            here += complaints(page)
            found += [f"{size_name}, {scheme}: {complaint}" for complaint in here]
            page.close()
    return status_of("walk_page", found)


if __name__ == "__main__":
    sys.exit(main())
