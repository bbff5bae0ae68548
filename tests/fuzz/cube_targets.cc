// Fuzz target: LUTs in .cube files.
#include <algorithm>
#include <cmath>

#include "pipeline/images/cube_file.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/mutate.h"

namespace regrade::testing {
namespace {

std::vector<std::string> Seeds() {
  const ColorTable table = TabulateColors(3, [](const Vec3d& c) { return c * 0.5; });
  return {
      CubeText(table, "half"),
      "# a curve\nTITLE \"a \\ b\"\r\nLUT_1D_SIZE 3\r\nDOMAIN_MIN -1 0 0\nDOMAIN_MAX 2 1 4\n"
      "0 0 0\n\n.5 0.25 1e-1 # half\n1 1 1",
      "LUT_3D_SIZE 2\nLUT_3D_INPUT_RANGE 0.0 1.5\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 0 1\n1 0 1\n"
      "0 1 1\n1 1 1\n"};
}

std::string Mutate(std::string text, FuzzRandom* random) {
  static const std::vector<std::string> kWords = {"TITLE",
                                                  "LUT_1D_SIZE",
                                                  "LUT_3D_SIZE",
                                                  "DOMAIN_MIN",
                                                  "DOMAIN_MAX",
                                                  "nan",
                                                  "inf",
                                                  "LUT_1D_INPUT_RANGE",
                                                  "LUT_3D_INPUT_RANGE",
                                                  "1e400",
                                                  "-0",
                                                  "129",
                                                  "\xef\xbb\xbf",
                                                  "65536",
                                                  "#",
                                                  "\r",
                                                  "1e-320"};
  return MutateText(std::move(text), kWords, random);
}

bool Read(std::string_view bytes) {
  return Accepts([bytes] {
    const ColorLut lut = ParseCube(bytes, "fuzz.cube");
    FuzzRequire(lut.table.size > 0 || lut.curves.values.size() >= 2, "it is a map");
    FuzzRequire(lut.table.size <= kMostTableSize, "the table is bounded");
    for (const double v : {-1.0, 0.0, 0.3, 1.0, 2.0}) {
      const Vec3d mapped = lut({v, 1 - v, 0.5});
      for (int c = 0; c < 3; ++c)
        FuzzRequire(std::abs(mapped[c]) <= 101, "colours are finite and bounded");
    }
    const double slope = lut.Slope();
    FuzzRequire(std::isfinite(slope) && slope >= 0, "its slope is finite");
  });
}

}  // namespace

std::vector<FuzzTarget> CubeTargets() { return {{"cube", Seeds, Read, Mutate}}; }

}  // namespace regrade::testing
