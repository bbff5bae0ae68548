// Looks from files: a LUT as a style, and a style as a LUT.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "pipeline/files/json_file.h"
#include "pipeline/images/cube_file.h"
#include "pipeline/images/image_file.h"
#include "tests/support/source_dir.h"
#include "tests/support/spawn.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

using testing::ProgramOutcome;
using testing::ReadText;
using testing::Regrade;
using testing::TemporaryFolder;
using testing::WriteText;

Vec3d Look(const Vec3d& c) {
  return {0.1 + 0.8 * c.x * c.x, 0.9 * c.y, 0.2 + 0.3 * c.z + 0.3 * c.x};
}

TEST(Looks, ALutIsAStyleAndAStyleALut) {
  const TemporaryFolder folder;
  testing::WriteCapture(folder / "s", 6, "96x72");
  WriteText(folder / "warm.cube", CubeText(TabulateColors(17, Look), "warm"));
  const ProgramOutcome outcome = Regrade({"run", folder / "s/truth", "--out", folder / "out",
                                          "--style", folder / "warm.cube", "--device", "cpu"},
                                         testing::TinyFlags());
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_SAYS(outcome, "the LUT magnifies differences");

  // 2D frames are the LUT on the frames' pixels: to the rounding of both files to 8 bits, which
  // the LUT magnifies 1.9 times at most.
  const std::string style = folder / "out/styles/warm";
  const ColorLut lut = ReadCubeFile(folder / "warm.cube");
  const Image before = ReadImage(style + "/frames/source/00000.png"),
              after = ReadImage(style + "/frames/views_2d/00000.png");
  for (int64_t i = 0; i < before.num_pixels(); ++i) {
    const float* p = &before.pixels[3 * i];
    const Vec3d mapped = lut({p[0], p[1], p[2]});
    for (int c = 0; c < 3; ++c)
      ASSERT_NEAR(after.pixels[3 * i + c], std::clamp(mapped[c], 0.0, 1.0),
                  (0.5 + 0.5 * 1.9) / 255 + 1e-6);
  }
  EXPECT_EQ(ReadText(style + "/report.json").find("sliced_wasserstein_to_style\":0"),
            std::string::npos);

  // What cannot go with a LUT.
  const auto refused = [&](std::vector<std::string> more, const std::string& says) {
    const ProgramOutcome end = Regrade({"stylize", folder / "out"}, more);
    EXPECT_NE(end.code, 0);
    EXPECT_SAYS(end, says);
  };
  refused({"--style", folder / "warm.cube", "--method", "gmm"}, "a LUT is its own method");
  WriteText(folder / "preset.xmp", "<x:xmpmeta/>");
  refused({"--style", folder / "preset.xmp"}, "is a look of another program");
  WriteText(folder / "bad.cube", "LUT_3D_SIZE 2\n0 0 0\n0 0\n");
  refused({"--style", folder / "bad.cube"}, "line 3 ends before its last number");

  // Back again: the styled scene's map.
  const ProgramOutcome exported =
      Regrade({"export", folder / "out", "--format", "cube", "--out", folder / "back.cube"});
  ASSERT_EQ(exported.code, 0) << exported.text;
  EXPECT_SAYS(exported, "dB from the styled scene");
  const ColorLut back = ReadCubeFile(folder / "back.cube");
  ASSERT_EQ(back.table.size, 33);
  EXPECT_EQ(back.title, "warm");
  // Three steps of training leave little more than the linear map of the LUT.
  double sum = 0;
  for (int64_t i = 0; i < before.num_pixels(); ++i) {
    const float* p = &before.pixels[3 * i];
    const Vec3d d = back({p[0], p[1], p[2]}) - lut({p[0], p[1], p[2]});
    sum += Dot(d, d) / 3;
  }
  EXPECT_LE(std::sqrt(sum / static_cast<double>(before.num_pixels())), 0.05);
  EXPECT_EQ(Regrade({"export", folder / "out", "--name", "warm", "--out", folder / "x"}).code,
            2);
}

}  // namespace
}  // namespace regrade
