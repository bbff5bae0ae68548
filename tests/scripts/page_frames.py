#!/usr/bin/env python3
"""Times a scene page's frames at 1280 x 720 on a graphics processor, without a window and without a browser.

  page_frames.py pack SCENE.html FOLDER [--views N] [--chromium PROGRAM]
  page_frames.py time FOLDER [--out FILE.json] [--frames N] [--size WxH] [--modes LIST] [--compute] [--device N]

`pack` opens the page in headless Chromium and writes its shader, its textures and what it draws with at the photos' places,
with a copy of this script: FOLDER alone is enough for `time`, on any machine with Python 3 and a driver. `time` draws with
OpenGL ES 3 through EGL, compares a small picture with the browser's, counts fetches, and prints and writes, for the page's
modes moving and rest (modes: moving, rest, exact): milliseconds a frame with a glFinish after each, median and 95th
percentile, and the same without waiting between frames. --compute runs the same shader as a compute shader (OpenGL ES 3.1),
for cards most of whose processors cannot run fragment shaders.

Libraries, the first that opens: libEGL.so.1, libEGL.so, libEGL_nvidia.so.0; libGLESv2.so.2, libGLESv2.so,
libGLESv2_nvidia.so.2. Displays, the first that is no software renderer, or else the first: the devices of
EGL_EXT_device_enumeration in their order (--device picks one), Mesa's surfaceless platform, the default display.
Exit status 1 if a picture differs, 77 if there is no Chromium or no EGL.
"""

import argparse
import base64
import bz2
import ctypes
import json
import math
import os
import re
import shutil
import statistics
import sys
import time

# ---- pack

# What graphics.draw asks of WebGL for one picture, by names.
RECORD = """(() => {
  const p = regradePage, g = p.graphics, photos = p.view.photos, [weights, place, width, height, step, count] = %s;
  const uniforms = [], textures = [], known = globalThis.packed ??= [];
  const gl = new Proxy(g.gl, {get: (of, name) => typeof of[name] !== 'function' ? of[name] : (where, ...rest) => {
    if (name.startsWith('uniform')) uniforms.push([name, where, rest.map((r) => typeof r === 'object' ? [...r] : r)]);
  }});
  const own = Object.create(g, {gl: {value: gl}, march: {value: {program: null, at: (name) => name}}, bind: {value: (_, name, unit, texture) => {
    if (!known.includes(texture)) known.push(texture);
    textures.push([name, unit, known.indexOf(texture)]);
  }}});
  p.view.go(photos[Math.floor(place * photos.length)]);
  const view = p.view.at(width, height);
  own.draw(p.scene, view, p.setsOf(weights), null, {width, height}, {x: 0, y: 0, width, height}, step ?? 0, count);
  return {uniforms, textures};
})()"""

SOURCES = "(() => { const {gl, march} = regradePage.graphics; return gl.getAttachedShaders(march.program).map((s) => gl.getShaderSource(s)) })()"

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

SMALL = (320, 180)  # of the picture that is compared


def pack(arguments):
    from browser import SIZES, open_page, running
    from page_pictures import pixels_of
    if not arguments.chromium:
        print("Chromium is not installed (Debian package chromium)")
        return 77
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
    shutil.copy(os.path.abspath(__file__), os.path.join(arguments.folder, "page_frames.py"))
    size = sum(os.path.getsize(os.path.join(arguments.folder, name)) for name in os.listdir(arguments.folder))
    print(f"{arguments.folder}: {size / 1e6:.1f} MB")
    return 0


# ---- time

EGL_NONE, EGL_TRUE = 0x3038, 1
SOFTWARE = re.compile("llvmpipe|softpipe|SwiftShader|swrast", re.I)


def opened(names):
    for name in names:
        try:
            return ctypes.CDLL(name)
        except OSError:
            continue
    return None


class Gl:
    """OpenGL ES 3 in a context without a surface; functions by their names without gl, floats given as such."""

    def __init__(self, device):
        self.egl = opened(["libEGL.so.1", "libEGL.so", "libEGL_nvidia.so.0"])
        self.library = opened(["libGLESv2.so.2", "libGLESv2.so", "libGLESv2_nvidia.so.2"])
        if self.egl is None:
            print("there is no libEGL (Debian packages libegl1, libgles2)")
            sys.exit(77)
        self.egl.eglGetProcAddress.restype = ctypes.c_void_p
        self.egl.eglGetProcAddress.argtypes = [ctypes.c_char_p]
        self.known = {}
        displays, tried = self.displays(device), []
        for name, display in displays:
            if self.begin(display):
                tried.append((name, display, self.text(0x1F01)))
        if not tried:
            print("EGL gives no OpenGL ES 3")
            sys.exit(77)
        self.display, display, self.renderer = next((t for t in tried if not SOFTWARE.search(t[2])), tried[0])
        self.begin(display)
        self.version = self.text(0x1F02)

    def egl_function(self, name, result, *kinds):
        at = self.egl.eglGetProcAddress(name.encode())
        return ctypes.CFUNCTYPE(result, *kinds)(at) if at else None

    def displays(self, wanted):
        pointer, integer = ctypes.c_void_p, ctypes.c_int32
        query = self.egl_function("eglQueryDevicesEXT", ctypes.c_uint, integer, ctypes.POINTER(pointer), ctypes.POINTER(integer))
        platform = self.egl_function("eglGetPlatformDisplayEXT", pointer, ctypes.c_uint, pointer, pointer)
        found = []
        if query and platform:
            devices, count = (pointer * 32)(), integer()
            query(32, devices, ctypes.byref(count))
            found += [(f"device {i}", platform(0x313F, devices[i], None)) for i in range(count.value)]
        if wanted is not None:
            return found[wanted:wanted + 1]
        if platform:
            found.append(("surfaceless", platform(0x31DD, None, None)))
        self.egl.eglGetDisplay.restype = pointer
        self.egl.eglGetDisplay.argtypes = [pointer]
        return found + [("default", self.egl.eglGetDisplay(None))]

    def begin(self, display):
        pointer, egl = ctypes.c_void_p, self.egl
        if not display:
            return False
        display = pointer(display)
        if not egl.eglInitialize(display, None, None):
            return False
        egl.eglBindAPI(0x30A0)
        config, count = pointer(), ctypes.c_int32()
        wanted = (ctypes.c_int32 * 5)(0x3040, 0x40, 0x3033, 0, EGL_NONE)  # OpenGL ES 3, no kind of surface
        if not egl.eglChooseConfig(display, wanted, ctypes.byref(config), 1, ctypes.byref(count)) or count.value == 0:
            return False
        egl.eglCreateContext.restype = pointer
        for minor in (1, 0):
            version = (ctypes.c_int32 * 5)(0x3098, 3, 0x30FB, minor, EGL_NONE)
            context = egl.eglCreateContext(display, config, None, version)
            if context and egl.eglMakeCurrent(display, None, None, pointer(context)):
                return True
        return False

    def __getattr__(self, name):
        if name not in self.known:
            at = self.egl.eglGetProcAddress(("gl" + name).encode())
            self.known[name] = ctypes.CFUNCTYPE(ctypes.c_void_p)(at) if at else getattr(self.library, "gl" + name)
            self.known[name].argtypes = None
        return self.known[name]

    def text(self, what):
        function = self.GetString
        function.restype = ctypes.c_char_p
        return (function(what) or b"").decode()


def program_of(gl, shaders):
    program = gl.CreateProgram() & 0xFFFFFFFF
    for kind, source in shaders:
        shader = gl.CreateShader(kind)
        text = ctypes.c_char_p(source.encode())
        gl.ShaderSource(shader, 1, ctypes.byref(text), None)
        gl.CompileShader(shader)
        done = ctypes.c_int32()
        gl.GetShaderiv(shader, 0x8B81, ctypes.byref(done))
        if not done.value:
            log = ctypes.create_string_buffer(4096)
            gl.GetShaderInfoLog(shader, 4096, None, log)
            raise RuntimeError("the driver refuses the shader: " + log.value.decode())
        gl.AttachShader(program, shader)
    gl.LinkProgram(program)
    done = ctypes.c_int32()
    gl.GetProgramiv(program, 0x8B82, ctypes.byref(done))
    if not done.value:
        raise RuntimeError("the driver refuses the program")
    return program


def as_compute(fragment):
    """The fragment shader as a compute shader: its pixel is its place, and its colour is stored."""
    body = fragment.replace("#version 300 es", "#version 310 es").replace("out vec4 color;", "vec4 color;\nlayout(local_size_x = 8, "
        "local_size_y = 8) in;\nlayout(rgba8, binding = 0) writeonly uniform highp image2D uOut;")
    body = body.replace("gl_FragCoord", "(vec2(gl_GlobalInvocationID.xy) + 0.5)").replace("void main()", "void Pixel()")
    return body + ("\nvoid main() { if (any(greaterThanEqual(vec2(gl_GlobalInvocationID.xy), uSize))) return; Pixel(); "
                   "imageStore(uOut, ivec2(gl_GlobalInvocationID.xy), color); }\n")


class Scene:
    def __init__(self, gl, folder, compute):
        self.gl, self.compute = gl, compute
        with open(os.path.join(folder, "scene.json"), encoding="utf-8") as file:
            self.about = json.load(file)
        vertex, fragment = self.about["shaders"]
        self.program = program_of(gl, [(0x91B9, as_compute(fragment))] if compute else [(0x8B31, vertex), (0x8B30, fragment)])
        self.textures = [self.texture(folder, t) for t in self.about["textures"]]
        array = ctypes.c_uint()
        gl.GenVertexArrays(1, ctypes.byref(array))
        gl.BindVertexArray(array)
        gl.UseProgram(self.program)
        self.targets = {}

    def texture(self, folder, about):
        with open(os.path.join(folder, about["file"]), "rb") as file:
            planes = bz2.decompress(file.read())
        width, channels, height = 4 * int(about["kind"][1]), int(about["kind"][1]), about["height"]
        data, n = bytearray(len(planes)), len(planes) // width
        for k in range(width):
            data[k::width] = planes[k * n:(k + 1) * n]
        signed = about["kind"][0] == "i"
        inside = {("u", 4): 0x8D70, ("u", 2): 0x823C, ("i", 1): 0x8235}[about["kind"][0], channels]
        form = {4: 0x8D99, 2: 0x8228, 1: 0x8D94}[channels]
        texture = self.blank(inside, 2048, height)
        buffer = (ctypes.c_char * len(data)).from_buffer(data)
        self.gl.TexSubImage2D(0x0DE1, 0, 0, 0, 2048, height, form, 0x1404 if signed else 0x1405, buffer)
        return texture

    def blank(self, inside, width, height):
        texture = ctypes.c_uint()
        self.gl.GenTextures(1, ctypes.byref(texture))
        self.gl.ActiveTexture(0x84C0 + 31)
        self.gl.BindTexture(0x0DE1, texture)
        self.gl.TexStorage2D(0x0DE1, 1, inside, width, height)
        for name in (0x2800, 0x2801):
            self.gl.TexParameteri(0x0DE1, name, 0x2600)
        return texture.value

    def target(self, size):
        if size not in self.targets:
            texture, framebuffer = self.blank(0x8058, *size), ctypes.c_uint()
            self.gl.GenFramebuffers(1, ctypes.byref(framebuffer))
            self.gl.BindFramebuffer(0x8D40, framebuffer)
            self.gl.FramebufferTexture2D(0x8D40, 0x8CE0, 0x0DE1, texture, 0)
            self.targets[size] = (framebuffer.value, texture)
        self.gl.BindFramebuffer(0x8D40, self.targets[size][0])
        if self.compute:
            self.gl.BindImageTexture(0, self.targets[size][1], 0, 0, 0, 0x88B9, 0x8058)

    def prepare(self, view, size, step, count=False):
        """Sets what the page sets; another size stretches the lens."""
        gl = self.gl
        for name, unit, index in view["textures"]:
            gl.ActiveTexture(0x84C0 + unit)
            gl.BindTexture(0x0DE1, self.textures[index])
            gl.Uniform1i(self.at(name), unit)
        packed = next(rest for _, where, rest in view["uniforms"] if where == "uSize")
        scale = size[1] / packed[1]
        for name, where, rest in view["uniforms"]:
            at = self.at(where)
            if at < 0:
                continue
            value = rest[-1]
            if where == "uLens":
                value = [v * scale for v in value]
                value[2] += (size[0] - scale * packed[0]) / 2
            elif where == "uSize":
                rest = list(map(float, size))
            elif where == "uOpacityStep":
                rest = [step]
            elif where == "uCount":
                rest = [int(count)]
            if name == "uniformMatrix3fv":
                gl.UniformMatrix3fv(at, 1, 1, (ctypes.c_float * 9)(*value))
            elif name.endswith("v"):
                kind, width = (ctypes.c_int32 if name[-2] == "i" else ctypes.c_float), int(name[7])
                getattr(gl, "U" + name[1:])(at, len(value) // width, (kind * len(value))(*value))
            else:
                kind = ctypes.c_int32 if name[-1] == "i" else ctypes.c_float
                getattr(gl, "U" + name[1:])(at, *map(kind, map(int if kind is ctypes.c_int32 else float, rest)))
        self.target(size)
        gl.Viewport(0, 0, *size)
        self.size = size

    def at(self, name):
        where = self.gl.GetUniformLocation(self.program, name.encode()) or 0
        return where - (1 << 32) if where & 0x80000000 and where < 1 << 32 else ctypes.c_int32(where & 0xFFFFFFFF).value

    def draw(self):
        if self.compute:
            self.gl.DispatchCompute((self.size[0] + 7) // 8, (self.size[1] + 7) // 8, 1)
        else:
            self.gl.DrawArrays(4, 0, 3)

    def pixels(self):
        data = ctypes.create_string_buffer(4 * self.size[0] * self.size[1])
        if self.compute:
            self.gl.MemoryBarrier(ctypes.c_uint(0xFFFFFFFF))
        self.gl.ReadPixels(0, 0, *self.size, 0x1908, 0x1401, data)
        return data.raw


def compare(scene):
    """Decibels from the browser's picture without opacity steps, and the part of the values within 1 of 255."""
    small = scene.about["small"]
    scene.prepare(small, SMALL, 0.0)
    scene.draw()
    got, want, width = scene.pixels(), base64.b64decode(small["pixels"]), SMALL[0]
    rows = [got[4 * width * y:4 * width * (y + 1)] for y in reversed(range(SMALL[1]))]
    flat = bytes(b for row in rows for i, b in enumerate(row) if i % 4 < 3)
    error = sum((a - b) ** 2 for a, b in zip(flat, want)) / len(want)
    return (99 if error == 0 else 10 * math.log10(255 ** 2 / error)), sum(abs(a - b) <= 1 for a, b in zip(flat, want)) / len(want)


def measure(scene, size, mode, frames):
    gl, views = scene.gl, scene.about["views"]
    step = scene.about["steps"].get(mode, 0)
    fetches, waited, flowing = [], [], []
    for view in views:
        scene.prepare(view, SMALL, step, True)
        scene.draw()
        counts = scene.pixels()
        fetches.append(sum(counts[k] + 256 * counts[k + 1] for k in range(0, len(counts), 4)) / (SMALL[0] * SMALL[1]))
        scene.prepare(view, size, step)
        each, warm = max(2, math.ceil(frames / len(views))), min(10, max(1, frames // 10))
        for i in range(warm + each):
            begun = time.perf_counter()
            scene.draw()
            gl.Finish()
            if i >= warm:
                waited.append(1000 * (time.perf_counter() - begun))
        begun = time.perf_counter()
        for _ in range(each):
            scene.draw()
            gl.Flush()
        gl.Finish()
        flowing.append(1000 * (time.perf_counter() - begun) / each)
    median, mean = statistics.median(waited), sum(fetches) / len(fetches)
    return {"mode": mode, "width": size[0], "height": size[1], "frames": len(waited), "ms_median": median,
            "ms_p95": sorted(waited)[int(0.95 * (len(waited) - 1))], "fps": 1000 / median,
            "ms_median_by_view": [statistics.median(waited[i * each:(i + 1) * each]) for i in range(len(views))],
            "ms_without_waiting": statistics.mean(flowing), "fetches_a_ray": mean,
            "fetches_a_second": mean * size[0] * size[1] * 1000 / median}


def time_frames(arguments):
    gl = Gl(arguments.device)
    scene = Scene(gl, arguments.folder, arguments.compute)
    decibels, near = compare(scene)
    result = {"renderer": gl.renderer, "version": gl.version, "display": gl.display, "shader": "compute" if arguments.compute else "fragment",
              "page": scene.about["page"], "voxels": scene.about["voxels"], "styled": scene.about["styled"],
              "graphics_bytes": scene.about["graphics_bytes"], "db_to_browser": decibels, "within_one": near, "modes": []}
    print(f"{gl.renderer}, {gl.version}, {gl.display}: {decibels:.1f} dB from the browser's picture, {100 * near:.2f} % within 1 of 255", flush=True)
    size = tuple(map(int, arguments.size.split("x")))
    for mode in arguments.modes.split(","):
        got = measure(scene, size, mode, arguments.frames)
        result["modes"].append(got)
        print(f"{mode:6} {size[0]} x {size[1]}: {got['ms_median']:.2f} ms a frame ({got['ms_p95']:.2f} at the 95th percentile of {got['frames']}), "
              f"{got['fps']:.1f} frames/s; {got['ms_without_waiting']:.2f} ms without waiting; {got['fetches_a_ray']:.1f} fetches a ray, "
              f"{got['fetches_a_second'] / 1e9:.2f} G/s", flush=True)
    error = gl.GetError()
    if arguments.out:
        with open(arguments.out, "w", encoding="utf-8") as file:
            json.dump(result, file, indent=1)
    # Another processor's arithmetic, as page_pictures.py's bounds.
    if error or decibels < 50:
        print(f"the picture differs from the browser's, or OpenGL reports {error}")
        return 1
    return 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    packing = commands.add_parser("pack")
    packing.add_argument("page")
    packing.add_argument("folder")
    packing.add_argument("--views", type=int, default=6)
    packing.add_argument("--chromium", default=shutil.which("chromium") or shutil.which("chromium-browser"))
    packing.set_defaults(do=pack)
    timing = commands.add_parser("time")
    timing.add_argument("folder")
    timing.add_argument("--out")
    timing.add_argument("--frames", type=int, default=120, help="of each mode, over all views")
    timing.add_argument("--size", default="1280x720")
    timing.add_argument("--modes", default="moving,rest")
    timing.add_argument("--compute", action="store_true")
    timing.add_argument("--device", type=int)
    timing.set_defaults(do=time_frames)
    arguments = parser.parse_args()
    return arguments.do(arguments)


if __name__ == "__main__":
    sys.exit(main())
