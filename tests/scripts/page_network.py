#!/usr/bin/env python3
"""Compares a page's styled voxels with the style's certified bound, and its pictures with the program's.

  page_network.py FOLDER [--chromium PROGRAM]

FOLDER is write_scene_pages's, of small fields or of a run (write_scene_pages FOLDER RUN STYLE): pages NAME.html with views
and pixels in NAME.json. The program and the page start from the same coefficients, as the page has them. Exit status 1
if a picture or a pair of voxels is out of bounds, 77 if there is no Chromium.

The bound of pairs of voxels x, y, with f of EQ(liprf-network) and bound K = ||A|| + R of EQ(liprf-bound):
  |F(x) - F(y)| <= (||A|| + R prod_l (1 + d_l / (s_l - d_l))) |x - y| + |c| + 2 e
F is f with weights rounded to halves and results rounded to codes. A layer's weights W change by at most d = 2^-11 |W|_F,
and 2^-25 each where they are below the smallest normal half; s <= ||W|| comes from power iterations. Rounding to codes of
the scales c moves a result by at most c / 2 in each channel, and limits do not move two results apart. e is of the
graphics processor's sine, 2^-11 in each of 64 values as Vulkan allows, through the layers that follow; of doubles it is 0.
"""

import glob
import json
import os
import sys

from browser import SIZES, complaints, open_page, parsed, parser_of, running, status_of
from page_pictures import compare_pictures

BOUND = """(async () => {
  const p = regradePage, gl = p.graphics.gl, style = p.header.styles[0], {source} = p.scene, n = p.scene.voxels;
  await p.load(0);
  const framebuffer = gl.createFramebuffer(), rows = Math.ceil(n / 2048);
  const codes = (texture) => {
    const data = new Uint32Array(4 * 2048 * rows);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture.texture, 0);
    gl.readPixels(0, 0, 2048, rows, gl.RGBA_INTEGER, gl.UNSIGNED_INT, data);
    return data;
  };
  const first = codes(source.first), second = codes(source.second), styled = p.colors[0];
  const low = new Uint8Array(first.buffer), high = new Uint8Array(second.buffer);
  const ownLow = new Uint8Array(codes(styled.first).buffer), ownHigh = new Uint8Array(codes(styled.second).buffer);
  gl.deleteFramebuffer(framebuffer);

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
  if (!p.graphics.onCores) for (let l = 1; l < 6; ++l) sine = (sine + 8 * 2 ** -11) * norms[l].s * (l < 5 ? style.omega : 1);
  const allowed = Math.hypot(...style.scale) + 2 * sine;

  const shift = p.header.finest === null ? 0.5 : 0, x = new Float64Array(30), y = new Float64Array(30);
  const features = (i, to) => {
    for (let k = 0; k < 27; ++k) to[k] = ((k < 16 ? low[16 * i + k] : high[16 * i + k - 16]) - 128) * source.scale[k];
    const b = second[4 * i + 3], place = [high[16 * i + 11] | (b & 31) << 8, b >>> 5 & 8191, b >>> 18 & 8191];
    for (let a = 0; a < 3; ++a) to[27 + a] = ((place[a] + shift) * p.scene.positionUnit[a] - 1) * style.position_scale;
  };
  let over = 0, steepest = 0, closest = 0, pairs = 0;
  for (let i = 0; i < n; ++i) {
    features(i, x);
    // The next voxel is near by, the other one anywhere.
    for (const j of [(i + 1) % n, (Math.imul(i + 1, 2654435761) >>> 0) % n]) {
      if (j === i) continue;
      features(j, y);
      let before = 0, after = 0;
      for (let k = 0; k < 30; ++k) before += (x[k] - y[k]) ** 2;
      for (let k = 0; k < 27; ++k)
        after += ((k < 16 ? ownLow[16 * i + k] - ownLow[16 * j + k] : ownHigh[16 * i + k - 16] - ownHigh[16 * j + k - 16]) * style.scale[k]) ** 2;
      before = Math.sqrt(before);
      after = Math.sqrt(after);
      ++pairs;
      over += after > bound * before + allowed;
      closest = Math.max(closest, after / (bound * before + allowed));
      if (before > 10 * allowed) steepest = Math.max(steepest, after / before);
    }
  }
  return {voxels: n, pairs, over, steepest, closest, certified: style.bound, bound, allowed};
})()"""


def check_bound(page):
    if page.value("!!regradePage.header.styles[0].residual"):
        return []  # the bound is the network's, and says nothing of what is added at two positions
    got = page.value(BOUND)
    print(f"  bound: {got['voxels']} voxels, {got['pairs']} pairs, {got['over']} over {got['bound']:.4f} |x - y| + {got['allowed']:.4f} "
          f"(certified {got['certified']:.4f}), nearest {100 * got['closest']:.1f} % of it, steepest {got['steepest']:.3f}")
    return [f"{got['over']} pairs of voxels exceed the certified bound"] if got["over"] else []


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
