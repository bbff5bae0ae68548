#!/usr/bin/env python3
"""Checks the layers: which folder includes which, which file includes which third-party library.

  check_layers.py [--root DIR]   checks the tree; one line for each finding

MODULES, LAYERS and ALLOWED below are the rules: a new folder or library needs a row. Exit status: 0, or 1 if there is a
finding.
"""

import os
import re
import sys

from tree_files import parser_of, read

# module -> the other modules that its files may include
MODULES = {
    "kernels": (),
    "reconstruct": ("kernels",),
    "stylize": ("kernels",),
    "evaluate": ("kernels",),
    "pipeline": ("kernels", "reconstruct", "stylize", "evaluate"),
    "tests": ("kernels", "reconstruct", "stylize", "evaluate", "pipeline"),
}

# folder -> its layer within its module: a file includes its own folder and folders of lower layers. A folder is one
# library, named after it; a program's main file has a row of its own.
LAYERS = {
    "kernels/base": 0,
    "kernels/process": 1,
    "kernels/device": 1,
    "kernels/scene": 1,
    "kernels/optimize": 1,
    "kernels/network": 1,
    "kernels/onnx": 1,
    "kernels/image": 2,
    "kernels/field": 2,
    "kernels/synthetic": 2,
    "kernels/network/cuda": 2,
    "kernels/field/cpu": 3,
    "kernels/field/cuda": 3,
    "kernels/image/cuda": 3,
    "kernels/splats": 3,
    "kernels/splats/cpu": 4,
    "kernels/splats/cuda": 4,
    "kernels/render": 5,
    "reconstruct/scene": 0,
    "reconstruct/colmap": 1,
    "reconstruct/fit": 1,
    "reconstruct/views": 1,
    "reconstruct/refinement": 2,
    "reconstruct/splats": 2,
    "stylize": 0,
    "stylize/image": 1,
    "stylize/field": 1,
    "stylize/cuda": 2,
    "stylize/training": 3,
    "evaluate": 0,
    "pipeline/files": 0,
    "pipeline/fields": 1,
    "pipeline/program": 1,
    "pipeline/images": 1,
    "pipeline/workspace": 2,
    "pipeline/capture": 3,
    "pipeline/page": 5,
    "pipeline/report": 3,
    "pipeline/run": 4,
    "pipeline/stages": 6,
    "pipeline/study": 7,
    "pipeline": 7,
    "pipeline/commands": 8,
    "pipeline/main.cc": 9,
}

# library, how its headers look, and the files that may include it (regular expressions of paths).
# Tests may include any library, to compare with it.
ANY_MODULE_SOURCE = r"(reconstruct|stylize|evaluate)/.*\.(cc|cu)"
ALLOWED = (
    ("OpenCV", r"opencv2/",
     (r"evaluate/(flow_module|optical_flow)\.cc", r"kernels/onnx/onnx_model\.cc", r"pipeline/images/(draw_text|edge_shift)\.cc")),
    ("FFmpeg", r"lib(av|sw)[a-z]+/", (r"pipeline/images/(ffmpeg_pointers|film_(decoder|frame)|joined_film|libraries|mp4_file|video_writer)\.cc",)),
    ("OpenImageIO", r"OpenImageIO/", (r"pipeline/images/oiio_module\.cc",)),
    ("libjpeg-turbo", r"(jpeglib|jerror|jmorecfg|turbojpeg)\.h", (r"pipeline/images/(jpeg_decoder|picture_encoder)\.cc",)),
    ("libheif", r"libheif/", (r"pipeline/images/(heif_decoder|libraries)\.cc",)),
    ("Little CMS", r"lcms2(_plugin)?\.h", (r"pipeline/images/color_profile\.cc",)),
    ("libpng", r"(png|pngconf|pnglibconf)\.h", (r"pipeline/images/(picture_encoder|png_decoder)\.cc",)),
    ("Ceres", r"(ceres|glog)/", (r"reconstruct/refinement/(bundle|exposure|refine_poses)\.cc",)),
    ("Boost", r"boost/", (r"pipeline/program/option_binding\.cc", r"pipeline/page/(local_server|request_reader)\.cc",
      r"pipeline/program/tensor_bundle\.cc", r"reconstruct/splats/initial_splats\.cc")),
    ("nlohmann-json", r"nlohmann/", (r"pipeline/files/[^/]*\.cc",)),
    ("libzip", r"(zip|zipconf|zlib)\.h", (r"pipeline/files/[^/]*\.cc",)),
    ("Zstandard", r"zstd(_errors)?\.h", (r"pipeline/files/zstd\.cc",)),
    ("libcurl", r"curl/", (r"pipeline/program/fetch_file\.cc",)),
    ("OpenSSL", r"openssl/", (r"pipeline/program/fetch_file\.cc",)),
    ("utfcpp", r"utf8cpp/", (r"pipeline/files/text\.cc",)),
    ("Eigen", r"(Eigen|unsupported/Eigen)/", (ANY_MODULE_SOURCE, r"kernels/image/color_statistics\.cc",
      r"pipeline/page/value_transform\.cc")),
    ("CUDA", r"(cuda|cub/|thrust/|cooperative_groups|mma\.h|nvtx|curand|cublas)",
     (r"kernels/device/.*", r"kernels/.*/cuda/.*", r"stylize/cuda/.*")),
    ("OpenMP", r"omp\.h", (r".*\.(cc|cu)", r"kernels/.*")),
    ("vector intrinsics", r"(immintrin|x86intrin)\.h", (r"kernels/.*",)),
    ("GoogleTest", r"(gtest|gmock)/", ()),
    ("Google Benchmark", r"benchmark/", ()),
)

# Standard C++ headers have no dot; these are C's and POSIX's (the latter in sources only).
C_HEADERS = re.compile(r"(assert|errno|limits|math|signal|stddef|stdint|stdio|stdlib|string|time)\.h")
POSIX_HEADERS = re.compile(
    r"(sys|netinet|arpa)/[a-z_]+\.h|"
    r"(dirent|dlfcn|fcntl|fnmatch|glob|langinfo|locale|malloc|poll|pthread|sched|spawn|strings|termios|unistd|wait)\.h")

# Patterns that are forbidden in code, with the reason.
FORBIDDEN = (
    # system() takes one argument; a matrix of that name takes two.
    (r"(?<![\w.>])(?:std\s*::\s*|::\s*)?system\s*\((?![^()]*,)", "system(): programs are started without a shell"),
    (r"(?<![\w.>])(?:std\s*::\s*|::\s*)?popen\s*\(", "popen(): programs are started without a shell"),
    (r"\bcomputeDirect\b", "computeDirect: a residual of 1e-8 where compute() has 3e-15"),
    (r"/\s*\(\s*1(?:\.0*)?f?\s*-\s*alpha\b", "division by 1 - alpha: 0/0 at opaque samples"),
)
FORBIDDEN_FLAGS = (
    (r"-ffast-math|-Ofast|-funsafe-math-optimizations|-ffinite-math-only|use_fast_math",
     "fast math: it removes the checks for NaN"),
)

SOURCE_SUFFIXES = (".h", ".cuh", ".cc", ".cu")
FLAG_FILES = re.compile(r"(CMakeLists\.txt|.*\.cmake|CMakePresets\.json)$")
MAX_LINES, MANY_LINES = 400, 300
# Bodies of fast paths, included once for each instruction set under another name.
COMPILED_OFTEN = "_simd.h"

INCLUDE = re.compile(r'^\s*#\s*include\s*(<([^>]+)>|"([^"]+)")', re.M)
# A comment, a string or a character: not searched for forbidden patterns.
NOT_CODE = re.compile(r'//[^\n]*|/\*.*?\*/|R"([^(\s]*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|(?<!\w)\'(?:\\.|[^\'\\\n])+\'',
                      re.S)


def code_only(text):
    """The text with comments and strings blanked out; line numbers stay."""
    return NOT_CODE.sub(lambda m: re.sub(r"[^\n]", " ", m.group(0)), text)


def line_of(text, offset):
    return text.count("\n", 0, offset) + 1


def row_of(path, layers):
    """The row of the table for a file: its own, or its folder's; None if there is none."""
    for row in (path, os.path.dirname(path)):
        if row in layers:
            return row
    return None


def check_arrow(source, target, layers):
    """The complaint about a row that uses another one, or None."""
    module, other = source.split("/")[0], target.split("/")[0]
    if module != other:
        return None if other in MODULES[module] else f"{module} may not use {other}"
    if source != target and layers[source] <= layers[target]:
        return f"{source} (layer {layers[source]}) may not use {target} (layer {layers[target]}): not below it"
    return None


def check_own_include(root, path, target, layers):
    """The complaint about a quoted include, or None."""
    if not os.path.isfile(os.path.join(root, target)):
        return f'"{target}": no such file; includes start at the root of the tree'
    if path.startswith("tests/"):
        return None
    source, row = row_of(path, layers), row_of(target, layers)
    if target.startswith("tests/"):
        return f'"{target}": tests are used by tests only'
    complaint = check_arrow(source, row, layers) if source and row else None
    return f'"{target}": {complaint}' if complaint else None


def circle_in(arrows):
    """[a, b, ..., a] where a uses b and so on, of {user: set of used}; None where there is no circle."""
    done = set()

    def walk(node, path):
        if node in path:
            return path[path.index(node):] + [node]
        if node in done:
            return None
        for used in sorted(arrows.get(node, ())):
            circle = walk(used, path + [node])
            if circle:
                return circle
        done.add(node)
        return None

    return next(filter(None, (walk(node, []) for node in sorted(arrows))), None)


def check_circles(includes, layers):
    """Findings of {path: own includes}: files, or folders, that include each other in a circle."""
    files, folders = {}, {}
    for path, targets in includes.items():
        files[path] = set(targets)
        for target in targets:
            source, row = row_of(path, layers), row_of(target, layers)
            if source and row and source != row:
                folders.setdefault(source, set()).add(row)
    return [(circle[0], 1, f"a circle of {what}: {' -> '.join(circle)}")
            for what, circle in (("files", circle_in(files)), ("folders", circle_in(folders))) if circle]


def check_library(root, row, layers):
    """Findings of a row's CMakeLists.txt: what lives there, one library named after the folder, layers below it."""
    path = row + "/CMakeLists.txt"
    if not os.path.isfile(os.path.join(root, path)):
        return [(path, 1, "missing: a folder is a library")]
    text = read(root, path)
    findings = []
    if not text.startswith("# "):
        findings.append((path, 1, "a CMakeLists.txt begins with a comment that describes its folder"))
    name = row.replace("/", "_")
    libraries = re.findall(r"^\s*regrade_library\((\w+)", text, re.M)
    if libraries != [name]:
        findings.append((path, 1, f"one library, {name}, not {', '.join(libraries) or 'none'}"))
    row_of_library = {folder.replace("/", "_"): folder for folder in layers}
    for call in re.finditer(r"(?:regrade_library|target_link_libraries)\(" + name + r"\s([^)]*)\)", text):
        links = call.group(1).split("LINK", 1)[-1] if "SOURCES" in call.group(1) else call.group(1)
        for used in (row_of_library.get(word) for word in links.split()):
            complaint = check_arrow(row, used, layers) if used else None
            if complaint:
                findings.append((path, line_of(text, call.start()), complaint))
    return findings


def check_foreign_include(path, target):
    """The complaint about an include in angle brackets, or None."""
    if re.fullmatch(r"[a-z0-9_]+", target) or C_HEADERS.fullmatch(target):
        return None
    is_header = path.endswith((".h", ".cuh"))
    if POSIX_HEADERS.fullmatch(target):
        return f"<{target}>: public headers use our own types only" if is_header else None
    for library, pattern, allowed in ALLOWED:
        if not re.match(pattern, target):
            continue
        if path.startswith("tests/"):
            return None
        if not any(re.fullmatch(file, path) for file in allowed):
            where = f" (only in {', '.join(allowed)})" if allowed else ""
            return f"<{target}>: {library} is not allowed here{where}"
        if is_header and not path.startswith("kernels/"):
            return f"<{target}>: public headers use our own types only"
        return None
    return f"<{target}>: unknown library; add it to ALLOWED in {os.path.basename(__file__)}"


def check_source(root, path, text, layers):
    findings = []
    if not path.startswith("tests/") and not row_of(path, layers):
        findings.append((1, f"{os.path.dirname(path)} has no row in LAYERS of {os.path.basename(__file__)}"))
    for match in INCLUDE.finditer(text):
        foreign, own = match.group(2), match.group(3)
        complaint = check_own_include(root, path, own, layers) if own else check_foreign_include(path, foreign)
        if complaint:
            findings.append((line_of(text, match.start()), complaint))
    code = code_only(text)
    for pattern, reason in FORBIDDEN:
        findings += [(line_of(code, m.start()), reason) for m in re.finditer(pattern, code)]
    if path.endswith((".h", ".cuh")):
        if not re.search(r"^#pragma once$", text, re.M) and not path.endswith(COMPILED_OFTEN):
            findings.append((1, "no #pragma once"))
        if not text.startswith(("//", "/*")):
            findings.append((1, "a header begins with a comment that describes it"))
    return findings


def files_to_check(root):
    """Paths below the root, with / in them: our sources, and what carries compiler flags."""
    for folder, subfolders, names in os.walk(root):
        relative = os.path.relpath(folder, root).replace(os.sep, "/")
        relative = "" if relative == "." else relative + "/"
        if not relative:
            subfolders[:] = [s for s in subfolders if s in (*MODULES, "cmake")]
        subfolders.sort()
        for name in sorted(names):
            if name.endswith(SOURCE_SUFFIXES) or FLAG_FILES.match(name):
                yield relative + name


def check_tree(root, layers):
    """(findings, remarks), each a list of (path, line, text)."""
    findings, remarks, includes = [], [], {}
    for path in files_to_check(root):
        text = read(root, path)
        lines = text.count("\n")
        if FLAG_FILES.match(path.rsplit("/", 1)[-1]):
            without_comments = re.sub(r"#[^\n]*", "", text)
            for pattern, reason in FORBIDDEN_FLAGS:
                findings += [(path, line_of(without_comments, m.start()), reason)
                             for m in re.finditer(pattern, without_comments)]
            continue
        findings += [(path, line, complaint) for line, complaint in check_source(root, path, text, layers)]
        includes[path] = [own for _, _, own in INCLUDE.findall(text) if own]
        if lines > MAX_LINES:
            findings.append((path, lines, f"{lines} lines: above {MAX_LINES}, split the file"))
        elif lines > MANY_LINES:
            remarks.append((path, lines, f"{lines} lines: above {MANY_LINES}"))
    findings += check_circles(includes, layers)
    for row in layers:
        if not row.endswith(".cc"):
            findings += check_library(root, row, layers)
        elif not os.path.isfile(os.path.join(root, row)):
            findings.append((row, 1, "no such file, but a row in the table of layers"))
    return findings, remarks


def main():
    arguments = parser_of(__doc__).parse_args()
    findings, remarks = check_tree(arguments.root, LAYERS)
    for path, line, text in remarks:
        print(f"{path}:{line}: remark: {text}")
    for path, line, text in findings:
        print(f"{path}:{line}: {text}")
    print(f"check_layers: {len(findings)} findings")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
