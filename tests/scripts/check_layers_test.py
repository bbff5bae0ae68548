#!/usr/bin/env python3
"""Plants one violation at a time in a correct tree; check_layers.py must find each, and nothing in the correct tree."""

import unittest

from planted_tree import planted

import check_layers

RUN_LIBRARY = "pipeline/run/CMakeLists.txt"
TIDY = {
    "kernels/base/vec.h": "// Vectors.\n#pragma once\n#include <cmath>\n",
    "kernels/scene/camera.h": '// Cameras.\n#pragma once\n#include "kernels/base/vec.h"\n',
    "kernels/field/grid.h": '// A grid.\n#pragma once\n#include "kernels/scene/camera.h"\n',
    "reconstruct/colmap/model.h": '// A model.\n#pragma once\n#include "kernels/scene/camera.h"\n',
    "reconstruct/fit/fit.h": '// Fits.\n#pragma once\n#include "kernels/field/grid.h"\n',
    "reconstruct/refinement/exposure.cc": '#include <ceres/ceres.h>\n#include <Eigen/Core>\n'
                                          '#include "reconstruct/colmap/model.h"\n',
    "stylize/image/style.h": '// Styles; no system() here.\n#pragma once\n#include "kernels/base/vec.h"\n',
    "stylize/field/loss.h": '// A loss.\n#pragma once\n#include "kernels/field/grid.h"\n',
    "stylize/cuda/loss.cu": '#include <cuda_runtime.h>\n#include "stylize/field/loss.h"\n',
    "evaluate/optical_flow.cc": "#include <opencv2/video.hpp>\n#include <unistd.h>\n",
    "pipeline/files/json.h": "// JSON.\n#pragma once\n",
    "pipeline/capture/store.h": '// Stores.\n#pragma once\n#include "pipeline/files/json.h"\n',
    "pipeline/report/page.h": '// A page.\n#pragma once\n#include "pipeline/files/json.h"\n',
    "pipeline/run/settings.h": '// Settings.\n#pragma once\n#include "pipeline/capture/store.h"\n',
    "pipeline/commands/command.h": '// Commands.\n#pragma once\n#include "pipeline/run/settings.h"\n',
    "pipeline/main.cc": '#include "pipeline/commands/command.h"\n#include "stylize/image/style.h"\n'
                        'const char* k = "system(";  // popen( in a comment\n'
                        "int n = ecosystem(1) + a.system(2) + system(i, j) + 1\'000;\n",
    "tests/kernels/vec_test.cc": '#include <gtest/gtest.h>\n#include "kernels/base/vec.h"\n',
    "CMakeLists.txt": "# -ffast-math is forbidden\nproject(x)\n",
}
LAYERS = {row: layer for row, layer in check_layers.LAYERS.items()
          if any(check_layers.row_of(path, check_layers.LAYERS) == row for path in TIDY)}


def header(include):
    return f'// A.\n#pragma once\n#include "{include}"\n'


def library(name, rest):
    return f"# What lives here.\nregrade_library({name}\n  SOURCES a.cc{rest}\n"


PLANTED = (
    # Layers: between modules, between folders of a module, and circles.
    ("kernels/base/a.h", header("kernels/scene/camera.h"), "not below it"),
    ("kernels/scene/a.h", header("kernels/field/grid.h"), "not below it"),
    ("kernels/field/a.cc", '#include "reconstruct/fit/fit.h"\n', "kernels may not use reconstruct"),
    ("reconstruct/fit/a.cc", '#include "stylize/image/style.h"\n', "reconstruct may not use stylize"),
    ("stylize/image/a.cc", '  #  include "reconstruct/fit/fit.h"\n', "stylize may not use reconstruct"),
    ("evaluate/a.cc", '#include "stylize/image/style.h"\n', "evaluate may not use stylize"),
    ("evaluate/a.cc", '#include "pipeline/files/json.h"\n', "evaluate may not use pipeline"),
    ("reconstruct/fit/a.h", header("reconstruct/colmap/model.h"), "not below it"),
    ("stylize/image/a.cc", '#include "stylize/field/loss.h"\n', "not below it"),
    ("pipeline/files/a.h", header("pipeline/commands/command.h"), "not below it"),
    ("pipeline/capture/a.cc", '#include "pipeline/run/settings.h"\n', "not below it"),
    ("pipeline/capture/a.cc", '#include "pipeline/report/page.h"\n', "not below it"),
    ("pipeline/capture/store.h", header("pipeline/run/settings.h"), "a circle of files"),
    ("pipeline/capture/a.h", header("pipeline/run/settings.h"), "a circle of folders"),
    ("stylize/field/loss.h", header("stylize/field/loss.h"), "a circle of files"),
    ("kernels/base/a.h", header("tests/kernels/vec_test.cc"), "by tests only"),
    ("stylize/image/a.cc", '#include "style.h"\n', "no such file"),
    # Folders and their libraries.
    ("pipeline/odd/a.cc", "int x;\n", "has no row"),
    ("pipeline/a.cc", "int x;\n", "has no row"),
    (RUN_LIBRARY, "regrade_library(pipeline_run SOURCES a.cc)\n", "begins with a comment"),
    (RUN_LIBRARY, library("pipeline", ")"), "one library, pipeline_run"),
    (RUN_LIBRARY, library("pipeline_run", ")\nregrade_library(other SOURCES b.cc)"), "one library"),
    (RUN_LIBRARY, library("pipeline_run", "\n  LINK kernels_base pipeline_commands)"), "not below"),
    ("stylize/field/CMakeLists.txt", library("stylize_field", "\n  LINK reconstruct_fit)"), "stylize may not use"),
    ("kernels/base/CMakeLists.txt",
     library("kernels_base", ")\ntarget_link_libraries(kernels_base PRIVATE kernels_scene)"), "not below it"),
    # Third-party libraries.
    ("evaluate/a.cc", "#include <opencv2/core.hpp>\n", "OpenCV is not allowed"),
    ("pipeline/files/a.cc", "#include <libavformat/avformat.h>\n", "FFmpeg is not allowed"),
    ("pipeline/files/a.cc", "#include <OpenImageIO/imageio.h>\n", "OpenImageIO is not allowed"),
    ("pipeline/files/a.cc", "#include <jpeglib.h>\n", "libjpeg-turbo is not allowed"),
    ("reconstruct/fit/a.cc", "#include <ceres/ceres.h>\n", "Ceres is not allowed"),
    ("pipeline/run/a.cc", "#include <boost/program_options.hpp>\n", "Boost is not allowed"),
    ("pipeline/run/a.cc", "#include <nlohmann/json.hpp>\n", "nlohmann-json is not allowed"),
    ("pipeline/run/a.cc", "#include <zip.h>\n", "libzip is not allowed"),
    ("pipeline/run/a.cc", "#include <utf8cpp/utf8.h>\n", "utfcpp is not allowed"),
    ("pipeline/run/a.cc", "#include <Eigen/Core>\n", "Eigen is not allowed"),
    ("stylize/field/a.cc", "#include <cuda_runtime.h>\n", "CUDA is not allowed"),
    ("kernels/field/a.cc", "#include <cuda_runtime.h>\n", "CUDA is not allowed"),
    ("reconstruct/fit/a.h", "// A.\n#pragma once\n#include <Eigen/Core>\n", "Eigen is not allowed"),
    ("pipeline/files/a.h", "// A.\n#pragma once\n#include <nlohmann/json.hpp>\n", "is not allowed"),
    ("pipeline/run/a.h", "// A.\n#pragma once\n#include <unistd.h>\n", "own types"),
    ("pipeline/run/a.cc", "#include <tbb/tbb.h>\n", "unknown library"),
    # Words.
    ("pipeline/run/a.cc", 'void F() { std::system("ls"); }\n', "system()"),
    ("pipeline/run/a.cc", "int n = ::system(Join(a, b));\n", "system()"),
    ("pipeline/run/a.cc", 'auto f = popen("ls", "r");\n', "popen()"),
    ("kernels/field/a.cc", "solver.computeDirect(m);\n", "computeDirect"),
    ("kernels/field/a.cc", "float g = w / (1.f - alpha);\n", "1 - alpha"),
    ("kernels/field/a.h", "// A.\nint F();\n", "#pragma once"),
    ("kernels/field/a.h", "#pragma once\nint F();\n", "begins with a comment"),
    ("kernels/field/a.cc", "int x;\n" * (check_layers.MAX_LINES + 1), "split the file"),
    ("cmake/CMakeLists.txt", "add_compile_options(-O3 -ffast-math)\n", "fast math"),
    ("cmake/a.cmake", "add_compile_options(-Ofast)\n", "fast math"),
    # Files that are missing.
    (RUN_LIBRARY, None, "missing: a folder is a library"),
    ("pipeline/main.cc", None, "no such file, but a row"),
)


class CheckLayers(unittest.TestCase):
    def findings(self, extra):
        libraries = {row + "/CMakeLists.txt": library(row.replace("/", "_"), ")") for row in LAYERS if not row.endswith(".cc")}
        with planted({**TIDY, **libraries, **extra}) as root:
            return check_layers.check_tree(root, LAYERS)[0]

    def test_correct_tree(self):
        self.assertEqual(self.findings({}), [])

    def test_planted(self):
        for path, text, expected in PLANTED:
            with self.subTest(expected, path=path):
                found = self.findings({path: text})
                if "circle" in expected:
                    self.assertTrue(any(expected in what for _, _, what in found), found)
                    continue
                others = [what for where, _, what in found if not (where == path and expected in what)]
                self.assertLess(len(others), len(found), found)
                # An upward include that closes a circle is found as both.
                self.assertFalse([what for what in others if "a circle of folders" not in what])


if __name__ == "__main__":
    unittest.main()
