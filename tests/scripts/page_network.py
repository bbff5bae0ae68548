#!/usr/bin/env python3
"""Compares a page's styled splats with the style's certified bound, and its pictures with the program's.

  page_network.py FOLDER [--chromium PROGRAM]

FOLDER is write_scene_pages's, of small fields or of a run (write_scene_pages FOLDER RUN STYLE): pages NAME.html with views
and pixels in NAME.json. The program and the page start from the same coefficients, as the page has them. Exit status 1
if a picture or a pair of splats is out of bounds, 77 if there is no Chromium.

The bound of pairs of splats x, y, with f of EQ(liprf-network) and bound K = ||A|| + R of EQ(liprf-bound):
  |F(x) - F(y)| <= (||A|| + R prod_l (1 + d_l / (s_l - d_l))) |x - y| + |c| + 2 e
F is f with weights rounded to halves and results rounded to numbers. A layer's weights W change by at most d = 2^-11 |W|_F,
and 2^-25 each where they are below the smallest normal half; s <= ||W|| comes from power iterations. Rounding to numbers
of the steps c moves a result by at most c / 2 along each axis of an orthogonal transform, and limits do not move two results
apart. e is of the
graphics processor's sine, 2^-11 in each of 64 values as Vulkan allows, through the layers that follow; of single precision on
cores, 2^-18: sums of 64 terms and a sine within 2^-22.
"""

import glob
import json
import os
import sys

from browser import SIZES, complaints, open_page, parsed, parser_of, running, status_of
from page_pictures import compare_pictures

BOUND = """(async () => {
  const p = regradePage, gl = p.graphics.gl, style = p.header.styles[0], {source} = p.scene, n = p.scene.count;
  await p.load(0);
  const framebuffer = gl.createFramebuffer(), rows = Math.ceil(p.scene.count / 2048);
  const words = (texture) => {
    const data = new Uint32Array(4 * 2048 * rows);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture.texture, 0);
    gl.readPixels(0, 0, 2048, rows, gl.RGBA_INTEGER, gl.UNSIGNED_INT, data);
    return data;
  };
  const styled = p.colors[0], before27 = words(source.color), after27 = words(styled.color);
  const places = new Uint32Array(await p.scene.kept.place.arrayBuffer());
  gl.deleteFramebuffer(framebuffer);
  // A splat's numbers, times their steps: coefficients but for a rotation, which keeps distances.
  const ORDER = [[0, 11, 4, 21, 14, 24, 17], [1, 18, 19, 6, 7, 16, 25], [9, 3, 12, 13, 22, 23, 26], [2, 10, 5, 20, 15, 8]];
  const numbers = (data, code, i, to) => ORDER.forEach((list, w) => {
    let word = data[4 * i + w];
    for (const k of list) {
      to[k] = (word >> 32 - code.bits[k]) * code.step[k];
      word <<= code.bits[k];
    }
  });

  const packed = Uint8Array.from(atob(network_0.textContent), (c) => c.charCodeAt(0));
  const bytes = await new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate'))).arrayBuffer();
  const half = new Uint16Array(bytes), number = (h) => {
    const e = h >> 10 & 31, m = h & 1023;
    return (h & 0x8000 ? -1 : 1) * (e === 0 ? m * 2 ** -24 : (1024 + m) * 2 ** (e - 25));
  };
  // Norms of the layers: from below, and by how much rounding may have changed them.
  const norms = [];
  let at = 0;
  for (const [inputs, outputs] of [[30, 64], [64, 64], [64, 64], [64, 64], [64, 64], [64, 27]]) {
    const w = Float64Array.from({length: inputs * outputs}, (_, i) => number(half[at + i]));
    at += inputs * outputs + outputs;
    let v = Float64Array.from({length: inputs}, (_, i) => Math.sin(i + 1)), s = 0;
    for (let k = 0; k < 500; ++k) {
      const length = Math.hypot(...v), u = new Float64Array(outputs), next = new Float64Array(inputs);
      for (let o = 0; o < outputs; ++o) for (let i = 0; i < inputs; ++i) u[o] += w[o * inputs + i] * v[i] / length;
      s = Math.hypot(...u);
      for (let o = 0; o < outputs; ++o) for (let i = 0; i < inputs; ++i) next[i] += w[o * inputs + i] * u[o];
      v = next;
    }
    const d = 2 ** -11 * Math.hypot(...w) * (1 + 2 ** -10) + 2 ** -25 * Math.sqrt(w.length);
    norms.push({s, d});
  }
  const B = style.base, gram = [0, 1, 2].map((i) => [0, 1, 2].map((j) => [0, 1, 2].reduce((sum, k) => sum + B[3 * i + k] * B[3 * j + k], 0)));
  let e = [1, 0.9, 0.8], base = 0;
  for (let k = 0; k < 500; ++k) {
    const next = gram.map((row) => row[0] * e[0] + row[1] * e[1] + row[2] * e[2]);
    base = Math.sqrt(Math.hypot(...next) / (Math.hypot(...e) || 1));
    e = next.map((x) => x / (Math.hypot(...next) || 1));
  }
  const rounded = norms.reduce((all, {s, d}) => all * (1 + d / (s - d)), 1);
  const bound = base + (style.bound - base) * rounded;
  let sine = 0;
  const each = 8 * (p.graphics.onCores ? 2 ** -18 : 2 ** -11);
  for (let l = 1; l < 6; ++l) sine = (sine + each) * norms[l].s * (l < 5 ? style.omega : 1);
  const allowed = Math.hypot(...styled.code.step) + 2 * sine;

  const {shift} = p.scene, x = new Float64Array(30), y = new Float64Array(30);
  const features = (i, to) => {
    numbers(before27, source.code, i, to);
    const a = places[2 * i], place = [a & 65535, a >>> 16, places[2 * i + 1]];
    for (let k = 0; k < 3; ++k) to[27 + k] = ((place[k] + shift) * p.scene.positionUnit[k] - 1) * style.position_scale;
  };
  const own = new Float64Array(27), other = new Float64Array(27);
  let over = 0, steepest = 0, closest = 0, pairs = 0;
  for (let i = 0; i < n; ++i) {
    features(i, x);
    numbers(after27, styled.code, i, own);
    // The next splat is near by, the other one anywhere.
    for (const j of [(i + 1) % n, (Math.imul(i + 1, 2654435761) >>> 0) % n]) {
      if (j === i) continue;
      features(j, y);
      numbers(after27, styled.code, j, other);
      let before = 0, after = 0;
      for (let k = 0; k < 30; ++k) before += (x[k] - y[k]) ** 2;
      for (let k = 0; k < 27; ++k) after += (own[k] - other[k]) ** 2;
      before = Math.sqrt(before);
      after = Math.sqrt(after);
      ++pairs;
      over += after > bound * before + allowed;
      closest = Math.max(closest, after / (bound * before + allowed));
      if (before > 10 * allowed) steepest = Math.max(steepest, after / before);
    }
  }
  return {splats: n, pairs, over, steepest, closest, certified: style.bound, bound, allowed};
})()"""


def check_bound(page):
    if page.value("!!regradePage.header.styles[0].residual"):
        return []  # the bound is the network's, and says nothing of what is added at two positions
    got = page.value(BOUND)
    print(f"  bound: {got['splats']} splats, {got['pairs']} pairs, {got['over']} over {got['bound']:.4f} |x - y| + {got['allowed']:.4f} "
          f"(certified {got['certified']:.4f}), nearest {100 * got['closest']:.1f} % of it, steepest {got['steepest']:.3f}")
    return [f"{got['over']} pairs of splats exceed the certified bound"] if got["over"] else []


def main():
    parser = parser_of(__doc__, shots=False)
    parser.add_argument("folder", help="folder with pages and their views")
    arguments = parsed(parser)
    found, files = [], sorted(glob.glob(os.path.join(arguments.folder, "*.html")))
    if not files:
        parser.error(arguments.folder + " has no pages")
    with running(arguments.chromium) as browser:
        for path in files:
            name = os.path.basename(path)[:-5]
            print(name, flush=True)
            with open(path[:-5] + ".json", encoding="utf-8") as file:
                views = json.load(file)
            page = open_page(browser, path, SIZES["phone"])
            here = compare_pictures(page, views) + check_bound(page) + complaints(page)
            found += [f"{name}: {complaint}" for complaint in here]
            page.close()
    return status_of("page_network", found)


if __name__ == "__main__":
    sys.exit(main())
