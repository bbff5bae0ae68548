"""A page's scene as page_pack.py wrote it, drawn with gles.py; a module of page_frames.py."""

import bz2
import ctypes
import json
import os

from gles import program_of

SMALL = (320, 180)  # of the picture that is compared with the browser's


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
                gl.UniformMatrix3fv(at, len(value) // 9, int(rest[0]), (ctypes.c_float * len(value))(*value))
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
