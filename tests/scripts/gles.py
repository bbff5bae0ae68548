"""OpenGL ES 3 through EGL without a window, by ctypes alone; a module of other scripts.

Libraries, the first that opens: libEGL.so.1, libEGL.so, libEGL_nvidia.so.0; libGLESv2.so.2, libGLESv2.so,
libGLESv2_nvidia.so.2. Displays, the first that is no software renderer, or else the first: the devices of
EGL_EXT_device_enumeration in their order, Mesa's surfaceless platform, the default display.
"""

import ctypes
import re
import sys

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
