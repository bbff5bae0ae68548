#!/usr/bin/env python3
"""Uses a scene page for long, takes its graphics processor away, and damages it.

  strain_page.py SCENE.html [--drags N] [--restyles N] [--pictures N] [--losses N] [--chromium PROGRAM]

Checked: drags of a style's slider, styles in the place of each other, dropped pictures and lost graphics contexts take no
memory that stays: objects and bytes on the graphics processor, counted at WebGL's own functions, which are those that the page
states, elements of the page, and the heap after garbage collection; after a lost context the canvas has the same pixels, the styles, the picture and the path;
damaged copies of the page say so. The page needs a style. Exit status 1 if anything is wrong, 77 if there is no Chromium.
"""

import os
import re
import sys
import tempfile

from browser import FEW_PIXELS, SIZES, Page, complaints, open_page, parsed, parser_of, running, status_of, wait_until

# Counts what exists on the graphics processor: gpu.size() is {objects, bytes}.
COUNTER = """(() => {
  const P = WebGL2RenderingContext.prototype, all = new Map(), bound = new Map();
  let unit = 0;
  const wrap = (name, after) => {
    const own = P[name];
    P[name] = function(...given) {
      const made = own.apply(this, given);
      after(made, given);
      return made;
    };
  };
  for (const kind of ['Texture', 'Framebuffer', 'Buffer', 'Program', 'Shader', 'VertexArray']) {
    wrap('create' + kind, (made) => all.set(made, 0));
    wrap('delete' + kind, (_, [gone]) => all.delete(gone));
  }
  wrap('activeTexture', (_, [number]) => unit = number);
  wrap('bindTexture', (_, [, texture]) => bound.set(unit, texture));
  wrap('bindBuffer', (_, [target, buffer]) => bound.set('buffer' + target, buffer));
  wrap('texStorage2D', (_, [, , format, width, height]) => {
    const bytes = {[P.RGBA32UI]: 16, [P.RG32UI]: 8, [P.R32I]: 4, [P.RGBA8]: 4, [P.RGBA16F]: 8}[format];
    if (!bytes) throw new Error('a texture of a format that is not counted');
    all.set(bound.get(unit), bytes * width * height);
  });
  wrap('bufferData', (_, [target, data]) => all.set(bound.get('buffer' + target), data.byteLength));
  addEventListener('webglcontextlost', () => { all.clear(); bound.clear(); }, true);
  globalThis.gpu = {size: () => ({objects: all.size, bytes: [...all.values()].reduce((sum, b) => sum + b, 0)})};
})()"""

STYLES = """(async () => {
  const style = {...regradePage.header.styles[0], weights: network_0.textContent};
  for (let i = 0; i < %d; ++i) await regradePage.putStyle(1, style);
  return regradePage.header.styles.length;
})()"""

PICTURES = """(async () => {
  for (let i = 0; i < %d; ++i) {
    const c = document.createElement('canvas'), x = c.getContext('2d');
    c.width = 640; c.height = 360;
    for (let k = 0; k < 64; ++k) { x.fillStyle = `hsl(${i * 31 + k * 5} 80%% ${20 + k %% 50}%%)`; x.fillRect(k * 10, 0, 10, 360); }
    await regradePage.take(new File([await new Promise((done) => c.toBlob(done))], 'a.png'));
  }
  return regradePage.state.map !== null;
})()"""

# What is shown, to the pixel, and what was set. The canvas keeps what was drawn.
SHOWN = """(() => {
  const p = regradePage;
  return JSON.stringify([canvas.width, canvas.toDataURL(), p.weights(), p.state, p.path.text(['a', 'b', 'c']), p.view.save(),
                         style0.value, style0.ariaValueText, dropped.hidden, half.hidden]);
})()"""

# The browser's own part of the heap was seen to differ by 200 kB from one garbage collection to the next, and compiled code
# to grow by 60 kB in the first repetitions. What a repetition could leave behind: a style's text, 50 kB, and its weights,
# 200 kB; a small scene, 1 MB.
NOISE_BYTES, LEAK_BYTES = 250e3, 15e3


def memory(page):
    wait_until(page, "regradePage.painter.settled && message.textContent === ''")
    heaps = []
    for _ in range(5):
        page.call("HeapProfiler.collectGarbage")
        heap = page.call("Runtime.getHeapUsage")
        heaps.append(heap["usedSize"] + heap.get("embedderHeapUsedSize", 0) + heap.get("backingStorageSize", 0))
    # The picture while moving has as many pixels as there is time for.
    gpu = page.value("(() => { const s = gpu.size(), c = regradePage.painter.coarse, own = regradePage.graphics.bytes, moving = "
                     "(c.sum ? 12 : 4) * c.width * c.height; return {objects: s.objects, bytes: s.bytes - moving, own: own - moving, "
                     "all: s.bytes - moving} })()")
    return {"heap": min(heaps), "elements": page.value("document.querySelectorAll('*').length"), **gpu}


def check_growth(page, what, times, repeat):
    """`repeat` runs twice the number of times; the second half adds nothing."""
    repeat(times)
    before = memory(page)
    repeat(times)
    after = memory(page)
    grown = {name: after[name] - before[name] for name in before}
    print(f"  {2 * times} {what}: heap {before['heap'] / 1e6:.2f} and {after['heap'] / 1e6:.2f} MB, {after['objects']} objects of "
          f"{after['bytes'] / 1e6:.2f} MB on the graphics processor, {grown['objects']} and {grown['bytes']} bytes more")
    found = [f"{times} {what} leave {grown[name]} {name} behind" for name in ["objects", "bytes", "own", "elements"] if grown[name] > 0]
    # What the page says in its panel is what WebGL was asked for.
    if after["own"] != after["all"]:
        found.append(f"after {what} the page counts {after['own']} bytes on the graphics processor, and there are {after['all']}")
    if grown["heap"] > NOISE_BYTES + LEAK_BYTES * times:
        found.append(f"{times} {what} leave {grown['heap']} bytes of the heap behind")
    return found


def drag(page, times):
    box = page.value("(() => { const r = style0.getBoundingClientRect(); return [r.x, r.y + r.height / 2, r.width] })()")
    for i in range(times):
        for part, kind in [(0.1, "mousePressed"), (0.5, "mouseMoved"), (0.3 + 0.6 * (i % 7) / 7, "mouseMoved"),
                           (0.3 + 0.6 * (i % 7) / 7, "mouseReleased")]:
            page.call("Input.dispatchMouseEvent", type=kind, x=box[0] + part * box[2], y=box[1], button="left", buttons=1, clickCount=1)
    if not page.value("regradePage.weights()[0] > 0.2"):
        raise RuntimeError("drags do not move the slider")


def check_strain(page, arguments):
    found = check_growth(page, "drags", arguments.drags // 2, lambda n: drag(page, n))
    found += check_growth(page, "styles", arguments.restyles // 2, lambda n: page.value(STYLES % n))
    found += check_growth(page, "pictures", arguments.pictures // 2, lambda n: page.value(PICTURES % n))
    return found


def lose(page, times):
    for _ in range(times):
        page.value("(() => { const c = canvas.getContext('webgl2').getExtension('WEBGL_lose_context'); globalThis.lost = c; "
                   "globalThis.graphics = regradePage.graphics; c.loseContext() })()")
        # The first word after the loss says what happens.
        wait_until(page, "/graphics processor was reset/.test(message.textContent)")
        page.value("lost.restoreContext()")
        wait_until(page, "regradePage.graphics !== globalThis.graphics && !regradePage.painter.scene.coarse && regradePage.painter.settled && "
                         "regradePage.weights().every((w, i) => !(w > 0) || !!regradePage.colors[i]) && message.textContent === ''")
    page.value("globalThis.graphics = globalThis.lost = null; 0")


def check_losses(page, times):
    """Two styles, a picture, a path and the split view come back, to the pixel."""
    page.value("""(async () => {
      const p = regradePage, style = {...p.header.styles[0], weights: network_0.textContent};
      if (p.header.styles.length < 2) await p.putStyle(1, style);
      halve.click(); add_key.click(); home.click(); add_key.click();
      p.state.amount = [0.3, 0.45];
      p.view.turn(0.2, 0.1);
      p.changed();
    })()""")
    page.value(PICTURES % 1)
    page.value("style0.value = 30; style0.dispatchEvent(new Event('input')); style1.value = 45; style1.dispatchEvent(new Event('input')); 0")
    wait_until(page, "regradePage.painter.settled")
    before = page.value(SHOWN)
    found = check_growth(page, "lost contexts", times // 2, lambda n: lose(page, n))
    if page.value(SHOWN) != before:
        found.append("after a lost context something else is shown")
    return found


def check_damaged(browser, path, folder):
    """Copies with a missing part, other bytes, no scene or no end say so, and throw nothing."""
    found = []
    with open(path, encoding="utf-8") as file:
        text = file.read()
    part = r'(id="color">)([^<]{40})'
    for name, damaged in {
            "missing": re.sub(r'<script type="application/octet-stream" id="shape">[^<]*</script>', "", text),
            "bytes": re.sub(part, lambda m: m[1] + m[2][:20] + m[2][:20], text),
            "base64": re.sub(part, lambda m: m[1] + "!!!" + m[2], text),
            "header": text.replace('"center":[', '"center":["x",', 1),
            "json": re.sub(r'(id="scene">)\{', r"\1", text),
            "end": text[:text.index('id="color">') + 400]}.items():
        copy = os.path.join(folder, "damaged_" + name + ".html")
        with open(copy, "w", encoding="utf-8") as file:
            file.write(damaged)
        page = Page(browser, copy, SIZES["phone"], scale=FEW_PIXELS)
        said = "the file is incomplete" if name == "end" else "cannot be shown: ."
        try:
            wait_until(page, f"/{said}/.test(message.textContent) && message.getClientRects().length > 0")
        except RuntimeError:
            found.append(f"a page with damaged {name} says '{page.value('message.textContent')}'")
        found += [f"a page with damaged {name}: {c}" for c in complaints(page)]
        page.close()
    return found


def main():
    parser = parser_of(__doc__, shots=False)
    parser.add_argument("page", help="a scene page with a style")
    parser.add_argument("--drags", type=int, default=40, help="of a style's slider (200)")
    parser.add_argument("--restyles", type=int, default=8, help="styles in the place of each other (50)")
    parser.add_argument("--pictures", type=int, default=8, help="dropped pictures (50)")
    parser.add_argument("--losses", type=int, default=4, help="lost graphics contexts (10)")
    arguments = parsed(parser)
    with tempfile.TemporaryDirectory() as scratch, running(arguments.chromium) as browser:
        page = open_page(browser, arguments.page, SIZES["phone"], COUNTER, FEW_PIXELS)
        found = check_strain(page, arguments) + check_losses(page, arguments.losses) + complaints(page)
        page.close()
        found += check_damaged(browser, arguments.page, scratch)
    return status_of("strain_page", found)


if __name__ == "__main__":
    sys.exit(main())
