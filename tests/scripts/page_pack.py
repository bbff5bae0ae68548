"""Writes what a scene page draws with, for page_frames.py on another machine; a module of that script."""

import base64
import bz2
import json
import os
import shutil

from browser import SIZES, open_page, running
from page_pictures import pixels_of
from page_scene import SMALL

# What a machine without a browser needs to draw.
NEEDED = ["page_frames.py", "page_frame_times.py", "page_scene.py", "gles.py"]

# What graphics.draw asks of WebGL for one picture, by names.
RECORD = """(() => {
  const p = regradePage, g = p.graphics, photos = p.view.photos, [weights, place, width, height, step, count] = %s;
  const uniforms = [], textures = [], known = globalThis.packed ??= [];
  const gl = new Proxy(g.gl, {get: (of, name) => typeof of[name] !== 'function' ? of[name] : (where, ...rest) => {
    if (name.startsWith('uniform')) uniforms.push([name, where, rest.map((r) => typeof r === 'object' ? [...r] : r)]);
  }});
  const own = Object.create(g, {gl: {value: gl}, marchOf: {value: () => ({program: null, sets: 1, checked: true, at: (name) => name})}, bind: {value: (_, name, unit, texture) => {
    if (!known.includes(texture)) known.push(texture);
    textures.push([name, unit, known.indexOf(texture)]);
  }}});
  p.view.go(photos[Math.floor(place * photos.length)]);
  const view = p.view.at(width, height);
  own.draw(p.scene, view, p.setsOf(weights), null, {width, height}, {x: 0, y: 0, width, height}, step ?? 0, count);
  return {uniforms, textures};
})()"""

SOURCES = "(() => { const {scene, graphics} = regradePage, {gl} = graphics; return gl.getAttachedShaders(graphics.marchOf(scene, 1).program).map((s) => gl.getShaderSource(s)) })()"

# Rows of a texture in base64.
ROWS = """(() => {
  const gl = regradePage.graphics.gl, [index, y, rows] = %s, texture = packed[index], n = 4 * 2048 * rows;
  const data = texture.kind[0] === 'i' ? new Int32Array(n) : new Uint32Array(n), framebuffer = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture.texture, 0);
  gl.readPixels(0, y, 2048, rows, gl.RGBA_INTEGER, texture.kind[0] === 'i' ? gl.INT : gl.UNSIGNED_INT, data);
  gl.deleteFramebuffer(framebuffer);
  const channels = Number(texture.kind[1]), bytes = new Uint8Array(data.buffer), out = new Uint8Array(4 * channels * 2048 * rows);
  for (let i = 0; i < 2048 * rows; ++i) out.set(bytes.subarray(16 * i, 16 * i + 4 * channels), 4 * channels * i);
  let s = '';
  for (let i = 0; i < out.length; i += 1 << 15) s += String.fromCharCode(...out.subarray(i, i + (1 << 15)));
  return btoa(s);
})()"""

def pack(arguments):
    os.makedirs(arguments.folder, exist_ok=True)
    with running(arguments.chromium) as browser:
        page = open_page(browser, arguments.page, SIZES["phone"])
        styles = page.value("regradePage.header.styles.length")
        weights = [1] + [0] * (styles - 1) if styles else []
        if styles:
            page.value("regradePage.load(0)")
        scene = {"page": os.path.basename(arguments.page), "voxels": page.value("regradePage.scene.voxels"),
                 "graphics_bytes": page.value("regradePage.graphics.bytes"), "styled": styles > 0,
                 "shaders": page.value(SOURCES), "steps": page.value("regradePage.painter.steps"), "views": []}
        for i in range(arguments.views):
            place = i / arguments.views
            scene["views"].append(page.value(RECORD % json.dumps([weights, place, 1280, 720, 0, False])))
        small = page.value(RECORD % json.dumps([weights, 0, *SMALL, 0, False]))
        view = page.value(f"regradePage.view.at({SMALL[0]}, {SMALL[1]})")
        small["pixels"] = base64.b64encode(pixels_of(page, {**view, "width": SMALL[0], "height": SMALL[1], "weights": weights})).decode()
        scene["small"] = small
        scene["textures"] = []
        for index in range(page.value("packed.length")):
            kind, height = page.value(f"[packed[{index}].kind, packed[{index}].height]")
            planes = [bytearray() for _ in range(4 * int(kind[1]))]
            for y in range(0, height, 64):
                data = base64.b64decode(page.value(ROWS % json.dumps([index, y, min(64, height - y)])))
                for k, plane in enumerate(planes):
                    plane += data[k::len(planes)]
            name = f"texture_{index}.bz2"
            with open(os.path.join(arguments.folder, name), "wb") as file:
                # Byte by byte of the texels, which packs better.
                file.write(bz2.compress(b"".join(planes)))
            scene["textures"].append({"file": name, "kind": kind, "height": height})
            print(f"{name}: {kind} x {height}", flush=True)
    with open(os.path.join(arguments.folder, "scene.json"), "w", encoding="utf-8") as file:
        json.dump(scene, file)
    for name in NEEDED:
        shutil.copy(os.path.join(os.path.dirname(os.path.abspath(__file__)), name), arguments.folder)
    size = sum(os.path.getsize(os.path.join(arguments.folder, name)) for name in os.listdir(arguments.folder))
    print(f"{arguments.folder}: {size / 1e6:.1f} MB")
    return 0
