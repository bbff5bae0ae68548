#!/usr/bin/env python3
"""Checks that the house keeps its floors and doors: who may include whom, and which library enters where.

  check_floors.py [--root DIR]   checks the tree; one line for each finding, exit status 1 if there is any
  check_floors.py --self-test    plants each kind of violation in a scratch tree and sees it found
"""

import argparse
import os
import re
import sys
import tempfile

# floor or wing -> what it may include of our own. The longest matching prefix speaks for a file.
MAY_INCLUDE = {
    "kernels/base/": ("kernels/base/",),
    "kernels/scene/": ("kernels/base/", "kernels/scene/"),
    "kernels/": ("kernels/",),
    "reconstruct/": ("kernels/", "reconstruct/"),
    "stylize/": ("kernels/", "stylize/"),
    "evaluate/": ("kernels/", "evaluate/"),
    "pipeline/": ("kernels/", "reconstruct/", "stylize/", "evaluate/", "pipeline/"),
    "tests/": ("kernels/", "reconstruct/", "stylize/", "evaluate/", "pipeline/", "tests/"),
}

# library, how its headers look, and the doors through which it enters (regular expressions of paths).
# Tests may include any library: they hold our code against it.
ANY_WING_SOURCE = r"(reconstruct|stylize|evaluate)/.*\.(cc|cu)"
DOORS = (
    ("OpenCV", r"opencv2/",
     (r"evaluate/(optical_flow|pair_network)\.cc", r"stylize/onnx_network\.cc", r"pipeline/files/video_file\.cc",
      r"pipeline/files/picture_text\.cc")),
    ("OpenImageIO", r"OpenImageIO/", (r"pipeline/files/image_file\.cc",)),
    ("libjpeg-turbo", r"(jpeglib|jerror|jmorecfg|turbojpeg)\.h", (r"pipeline/files/jpeg_decoder\.cc",)),
    ("libpng", r"(png|pngconf|pnglibconf)\.h", (r"pipeline/files/png_decoder\.cc",)),
    ("Ceres", r"(ceres|glog)/", (r"reconstruct/(exposure|refine_poses)\.cc",)),
    ("Boost", r"boost/", (r"pipeline/option_binding\.cc",)),
    ("nlohmann-json", r"nlohmann/", (r"pipeline/files/[^/]*\.cc",)),
    ("libzip", r"(zip|zipconf|zlib)\.h", (r"pipeline/files/[^/]*\.cc",)),
    ("spdlog", r"(spdlog|fmt)/", (r"pipeline/console\.cc",)),
    ("Eigen", r"(Eigen|unsupported/Eigen)/", (ANY_WING_SOURCE, r"kernels/image/color_statistics\.cc")),
    ("CUDA", r"(cuda|cub/|thrust/|cooperative_groups|mma\.h|nvtx|curand|cublas)", (r"kernels/.*",)),
    ("OpenMP", r"omp\.h", (r".*\.(cc|cu)", r"kernels/.*")),
    ("vector intrinsics", r"(immintrin|x86intrin)\.h", (r"kernels/.*",)),
    ("GoogleTest", r"(gtest|gmock)/", ()),
    ("Google Benchmark", r"benchmark/", ()),
)

# Standard C++ headers have no dot; these are C's and POSIX's (the latter in sources only).
C_HEADERS = re.compile(r"(assert|errno|limits|math|signal|stddef|stdint|stdio|stdlib|string|time)\.h")
POSIX_HEADERS = re.compile(
    r"(sys|netinet|arpa)/[a-z_]+\.h|"
    r"(dirent|dlfcn|fcntl|fnmatch|glob|langinfo|locale|poll|pthread|sched|spawn|strings|termios|unistd|wait)\.h")

# Words that do not appear in code, with the reason a reader gets.
FORBIDDEN = (
    # system() takes one argument; a matrix of that name takes two.
    (r"(?<![\w.>])(?:std\s*::\s*|::\s*)?system\s*\((?![^()]*,)", "system(): programs are started without a shell"),
    (r"(?<![\w.>])(?:std\s*::\s*|::\s*)?popen\s*\(", "popen(): programs are started without a shell"),
    (r"\bcomputeDirect\b", "computeDirect: a residual of 1e-8 where compute() has 3e-15"),
    (r"/\s*\(\s*1(?:\.0*)?f?\s*-\s*alpha\b", "division by 1 - alpha: 0/0 at opaque samples"),
)
FORBIDDEN_FLAGS = (
    (r"-ffast-math|-Ofast|-funsafe-math-optimizations|-ffinite-math-only|use_fast_math",
     "fast math: it deletes the tests for NaN"),
)

SOURCE_SUFFIXES = (".h", ".cuh", ".cc", ".cu")
FLAG_FILES = re.compile(r"(CMakeLists\.txt|.*\.cmake|CMakePresets\.json)$")
OUR_ROOMS = ("kernels", "reconstruct", "stylize", "evaluate", "pipeline", "tests")
MAX_LINES, MANY_LINES = 400, 300
# Bodies of fast paths, included once for each instruction set under another name.
COMPILED_OFTEN = "_simd.h"

INCLUDE = re.compile(r'^\s*#\s*include\s*(<([^>]+)>|"([^"]+)")', re.M)
# A comment, a string or a character: what the forbidden words are not looked for in.
NOT_CODE = re.compile(r'//[^\n]*|/\*.*?\*/|R"([^(\s]*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|(?<!\w)\'(?:\\.|[^\'\\\n])+\'',
                      re.S)


def code_only(text):
    """The text with comments and strings blanked out; line numbers stay."""
    return NOT_CODE.sub(lambda m: re.sub(r"[^\n]", " ", m.group(0)), text)


def line_of(text, offset):
    return text.count("\n", 0, offset) + 1


def check_own_include(root, path, target):
    """The complaint about a quoted include, or None."""
    if not os.path.isfile(os.path.join(root, target)):
        return f'"{target}": no such file; includes start at the root of the tree'
    room = max((prefix for prefix in MAY_INCLUDE if path.startswith(prefix)), key=len)
    if not target.startswith(MAY_INCLUDE[room]):
        return f'"{target}": {room} may include {", ".join(MAY_INCLUDE[room])} only'
    return None


def check_foreign_include(path, target):
    """The complaint about an include in angle brackets, or None."""
    if re.fullmatch(r"[a-z0-9_]+", target) or C_HEADERS.fullmatch(target):
        return None
    is_header = path.endswith((".h", ".cuh"))
    if POSIX_HEADERS.fullmatch(target):
        return f"<{target}>: public headers show our own nouns only" if is_header else None
    for library, pattern, doors in DOORS:
        if not re.match(pattern, target):
            continue
        if path.startswith("tests/"):
            return None
        if not any(re.fullmatch(door, path) for door in doors):
            return f"<{target}>: {library} does not enter here" + (f" (doors: {', '.join(doors)})" if doors else "")
        if is_header and not path.startswith("kernels/"):
            return f"<{target}>: public headers show our own nouns only"
        return None
    return f"<{target}>: unknown library; give it a door in {os.path.basename(__file__)}"


def check_source(root, path, text):
    findings = []
    for match in INCLUDE.finditer(text):
        foreign, own = match.group(2), match.group(3)
        complaint = check_own_include(root, path, own) if own else check_foreign_include(path, foreign)
        if complaint:
            findings.append((line_of(text, match.start()), complaint))
    code = code_only(text)
    for pattern, reason in FORBIDDEN:
        findings += [(line_of(code, m.start()), reason) for m in re.finditer(pattern, code)]
    if path.endswith((".h", ".cuh")):
        if not re.search(r"^#pragma once$", text, re.M) and not path.endswith(COMPILED_OFTEN):
            findings.append((1, "no #pragma once"))
        if not text.startswith(("//", "/*")):
            findings.append((1, "a header opens with a sentence that says what it is"))
    return findings


def files_to_check(root):
    """Paths below the root, with / in them: our rooms' sources, and what carries compiler flags."""
    for folder, subfolders, names in os.walk(root):
        relative = os.path.relpath(folder, root).replace(os.sep, "/")
        relative = "" if relative == "." else relative + "/"
        if not relative:
            subfolders[:] = [s for s in subfolders if s in OUR_ROOMS + ("cmake",)]
        subfolders.sort()
        for name in sorted(names):
            if name.endswith(SOURCE_SUFFIXES) or FLAG_FILES.match(name):
                yield relative + name


def check_tree(root):
    """(findings, remarks), each a list of (path, line, text)."""
    findings, remarks = [], []
    for path in files_to_check(root):
        with open(os.path.join(root, path), encoding="utf-8", errors="replace") as file:
            text = file.read()
        lines = text.count("\n")
        if FLAG_FILES.match(path.rsplit("/", 1)[-1]):
            without_comments = re.sub(r"#[^\n]*", "", text)
            for pattern, reason in FORBIDDEN_FLAGS:
                findings += [(path, line_of(without_comments, m.start()), reason)
                             for m in re.finditer(pattern, without_comments)]
            continue
        findings += [(path, line, complaint) for line, complaint in check_source(root, path, text)]
        if lines > MAX_LINES:
            findings.append((path, lines, f"{lines} lines: above {MAX_LINES}, look for the second idea"))
        elif lines > MANY_LINES:
            remarks.append((path, lines, f"{lines} lines: above {MANY_LINES}"))
    return findings, remarks


def self_test():
    """Plants one violation at a time in a tidy tree; each must be found, and the tidy tree be clean."""
    tidy = {
        "kernels/base/vec.h": "// Vectors.\n#pragma once\n#include <cmath>\n",
        "kernels/scene/camera.h": '// Cameras.\n#pragma once\n#include "kernels/base/vec.h"\n',
        "kernels/field/grid.h": '// A grid.\n#pragma once\n#include "kernels/scene/camera.h"\n',
        "reconstruct/fit.h": '// Fits.\n#pragma once\n#include "kernels/field/grid.h"\n',
        "reconstruct/exposure.cc": '#include <ceres/ceres.h>\n#include <Eigen/Core>\n#include "reconstruct/fit.h"\n',
        "stylize/style.h": '// Styles; no system() here.\n#pragma once\n#include "kernels/base/vec.h"\n',
        "evaluate/optical_flow.cc": "#include <opencv2/video.hpp>\n#include <unistd.h>\n",
        "pipeline/main.cc": '#include "reconstruct/fit.h"\n#include "stylize/style.h"\n'
                            'const char* k = "system(";  // popen( in a comment\n'
                            "int n = ecosystem(1) + a.system(2) + system(i, j) + 1\'000;\n",
        "tests/kernels/vec_test.cc": '#include <gtest/gtest.h>\n#include "kernels/base/vec.h"\n',
        "CMakeLists.txt": "# -ffast-math is forbidden\nproject(x)\n",
    }
    planted = (
        ("kernels/base/a.h", '// A.\n#pragma once\n#include "kernels/scene/camera.h"\n', "may include"),
        ("kernels/scene/a.h", '// A.\n#pragma once\n#include "kernels/field/grid.h"\n', "may include"),
        ("kernels/field/a.cc", '#include "reconstruct/fit.h"\n', "may include"),
        ("reconstruct/a.cc", '#include "stylize/style.h"\n', "may include"),
        ("stylize/a.cc", '  #  include "reconstruct/fit.h"\n', "may include"),
        ("evaluate/a.cc", '#include "stylize/style.h"\n', "may include"),
        ("stylize/a.cc", '#include "style.h"\n', "no such file"),
        ("evaluate/a.cc", "#include <opencv2/core.hpp>\n", "OpenCV does not enter"),
        ("pipeline/a.cc", "#include <OpenImageIO/imageio.h>\n", "OpenImageIO does not enter"),
        ("pipeline/a.cc", "#include <jpeglib.h>\n", "libjpeg-turbo does not enter"),
        ("reconstruct/a.cc", "#include <ceres/ceres.h>\n", "Ceres does not enter"),
        ("pipeline/a.cc", "#include <boost/program_options.hpp>\n", "Boost does not enter"),
        ("pipeline/a.cc", "#include <nlohmann/json.hpp>\n", "nlohmann-json does not enter"),
        ("pipeline/a.cc", "#include <zip.h>\n", "libzip does not enter"),
        ("pipeline/a.cc", "#include <spdlog/spdlog.h>\n", "spdlog does not enter"),
        ("pipeline/a.cc", "#include <Eigen/Core>\n", "Eigen does not enter"),
        ("stylize/a.cc", "#include <cuda_runtime.h>\n", "CUDA does not enter"),
        ("reconstruct/a.h", "// A.\n#pragma once\n#include <Eigen/Core>\n", "Eigen does not enter"),
        ("pipeline/files/a.h", "// A.\n#pragma once\n#include <nlohmann/json.hpp>\n", "does not enter"),
        ("pipeline/a.h", "// A.\n#pragma once\n#include <unistd.h>\n", "own nouns"),
        ("pipeline/a.cc", "#include <curl/curl.h>\n", "unknown library"),
        ("pipeline/a.cc", 'void F() { std::system("ls"); }\n', "system()"),
        ("pipeline/a.cc", "int n = ::system(Join(a, b));\n", "system()"),
        ("pipeline/a.cc", 'auto f = popen("ls", "r");\n', "popen()"),
        ("kernels/a.cc", "solver.computeDirect(m);\n", "computeDirect"),
        ("kernels/a.cc", "float g = w / (1.f - alpha);\n", "1 - alpha"),
        ("kernels/a.h", "// A.\nint F();\n", "#pragma once"),
        ("kernels/a.h", "#pragma once\nint F();\n", "opens with a sentence"),
        ("kernels/a.cc", "int x;\n" * (MAX_LINES + 1), "second idea"),
        ("kernels/CMakeLists.txt", "add_compile_options(-O3 -ffast-math)\n", "fast math"),
        ("cmake/a.cmake", "add_compile_options(-Ofast)\n", "fast math"),
    )
    failures = 0

    def findings_with(extra):
        with tempfile.TemporaryDirectory() as root:
            for path, text in {**tidy, **extra}.items():
                os.makedirs(os.path.dirname(os.path.join(root, path)) or root, exist_ok=True)
                with open(os.path.join(root, path), "w", encoding="utf-8") as file:
                    file.write(text)
            return check_tree(root)[0]

    for finding in findings_with({}):
        failures += 1
        print("self-test: a tidy tree is blamed:", *finding)
    for path, text, expected in planted:
        found = findings_with({path: text})
        if not any(where == path and expected in what for where, _, what in found) or len(found) != 1:
            failures += 1
            print(f"self-test: expected one finding '{expected}' in {path}, got {found}")
    print(f"self-test: {len(planted)} planted violations, {failures} failures")
    return failures


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--root", default=os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    parser.add_argument("--self-test", action="store_true")
    arguments = parser.parse_args()
    if arguments.self_test:
        return 1 if self_test() else 0
    findings, remarks = check_tree(arguments.root)
    for path, line, text in remarks:
        print(f"{path}:{line}: remark: {text}")
    for path, line, text in findings:
        print(f"{path}:{line}: {text}")
    print(f"check_floors: {len(findings)} findings")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
