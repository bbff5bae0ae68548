// Which renderer makes a film: what options and processor decide, and how the report says it.
#include "pipeline/stages/film_renderer.h"

#include <gtest/gtest.h>

#include "kernels/render/voxel_renderer.h"
#include "pipeline/run/presets.h"
#include "pipeline/run/resolve_settings.h"
#include "tests/support/psnr.h"
#include "tests/support/small_field.h"

namespace regrade {
namespace {

RunSettings Resolve(const std::vector<std::string>& flags) {
  RunSettings settings;
  OptionSet options;
  settings.Bind(&options);
  options.Parse(flags);
  ResolveSettings({}, &options);
  return settings;
}

std::string Why(const std::vector<std::string>& flags, bool film_of_views = false) {
  return WhyExactFilm(Resolve(flags), film_of_views);
}

TEST(FilmRenderer, IsFastUnlessAnOptionIsAgainstIt) {
  EXPECT_EQ(Why({}), "");
  EXPECT_EQ(Why({"--exact"}), "--exact");
  EXPECT_EQ(Why({"--reproducible"}), "--reproducible");
  EXPECT_EQ(Why({"--no-exact"}), "");
  for (const char* preset : kPresets) EXPECT_EQ(Why({"--preset", preset}), "") << preset;
}

TEST(FilmRenderer, IsExactWhereTheFilmShowsTheViews) {
  EXPECT_EQ(Why({}, true), "its frames are those of the views");
}

// A film is rendered again when this changes, but not on another processor.
TEST(FilmRenderer, OptionsDecideWhatIsRenderedAgain) {
  EXPECT_FALSE(WantsExactFilm(Resolve({})));
  EXPECT_FALSE(WantsExactFilm(Resolve({"--device", "cpu"})));
  EXPECT_TRUE(WantsExactFilm(Resolve({"--exact"})));
  EXPECT_TRUE(WantsExactFilm(Resolve({"--reproducible"})));
}

// Frames of a smooth field: few rays, and near the exact ones.
TEST(FilmRenderer, ThePreparedRenderersAreBothFastOrTheReasonIsGiven) {
  const RadianceField field = testing::RandomField({5, 5, 5}, 9, 0.5, 1);
  FieldRenderer source(field, Backend::kCpu), styled(field, Backend::kCpu);
  EXPECT_EQ(PrepareFilm(Resolve({"--exact"}), false, &source, &styled), "--exact");
  EXPECT_EQ(PrepareFilm(Resolve({}), false, &source, &styled), "");
  Camera camera;
  camera.width = 96, camera.height = 64;
  camera.fx = camera.fy = 90, camera.cx = 48, camera.cy = 32;
  camera.camera_from_world.translation = {0, 0, 3};
  const RenderedPair exact = source.RenderWith(styled, camera),
                     fast = source.RenderFastWith(styled, camera);
  EXPECT_GE(testing::Psnr(fast.view.color, exact.view.color), 55);
  EXPECT_NE(fast.view.color.pixels, exact.view.color.pixels);
}

TEST(FilmRenderer, TheReportNamesIt) {
  const FieldRenderer renderer(testing::RandomField({5, 5, 5}, 9, 0.5, 1), Backend::kCpu);
  EXPECT_EQ(FilmRendererText("", renderer), kFastRendererOfCpu);
  EXPECT_EQ(FilmRendererText("--exact", renderer), "exact (--exact)");
}

}  // namespace
}  // namespace regrade
