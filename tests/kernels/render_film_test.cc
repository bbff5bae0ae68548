// Frames of films in fewer rays, against frames with all of them.
#include "kernels/field/cpu/render_film.h"

#include <gtest/gtest.h>
#include <omp.h>

#include <cmath>

#include "tests/support/small_field.h"

namespace regrade {
namespace {

constexpr MarchOptions kMarch{0.5f, 1e-4f};

Camera CameraOf(int width, int height) {
  Camera camera;
  camera.width = width, camera.height = height;
  camera.fx = camera.fy = 1.2 * std::max(width, height);
  camera.cx = 0.5 * width, camera.cy = 0.5 * height;
  camera.camera_from_world.translation = {0.05, -0.1, 3};
  return camera;
}

// Coarse voxels under many pixels.
RadianceField Smooth(uint64_t seed) { return testing::RandomField({6, 6, 6}, 9, 0.5, seed); }

// Half the tolerance, over all pixels and channels.
constexpr double kAllowedRms = 1.0 / 255;

double Rms(const Image& a, const Image& b) {
  double sum = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i)
    sum += std::pow(double{a.pixels[i]} - double{b.pixels[i]}, 2);
  return std::sqrt(sum / static_cast<double>(a.pixels.size()));
}

TEST(FilmFrame, SmoothPartsAreInterpolated) {
  const FastGrid grid = MakeFastGrid(Smooth(3)), other = MakeFastGrid(Smooth(3));
  const Camera camera = CameraOf(160, 120);
  const RenderedPair all = RenderViewPair(grid, other, camera, kMarch);
  const FilmFrame frame = RenderFilmFrame(grid, other, camera, kMarch, 2.0f / 255);
  EXPECT_LT(frame.rays, 160 * 120 * 2 / 3);
  EXPECT_GT(frame.rays, 160 * 120 / 4);
  EXPECT_LT(Rms(frame.pair.view.color, all.view.color), kAllowedRms);
  EXPECT_LT(Rms(frame.pair.other_color, all.other_color), kAllowedRms);
  // Pixels of even x and y, and the frame's edge, are the exact ones.
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 160; ++x) {
      const bool rendered = (x % 2 == 0 && y % 2 == 0) || x == 0 || y == 119;
      for (int c = 0; c < 3 && rendered; ++c)
        ASSERT_EQ(frame.pair.view.color.at(x, y)[c], all.view.color.at(x, y)[c]);
    }
}

// What differs from pixel to pixel in either picture is rendered.
TEST(FilmFrame, RoughPartsOfEitherPictureAreRendered) {
  const RadianceField plain = testing::RandomField({96, 96, 96}, 9, 1, 5);
  RadianceField grey = plain;
  std::fill(grey.appearance.sh.begin(), grey.appearance.sh.end(), 0.0f);
  const FastGrid rough = MakeFastGrid(plain), flat = MakeFastGrid(grey);
  const Camera camera = CameraOf(64, 48);
  for (const bool first : {false, true}) {
    const FastGrid &a = first ? rough : flat, &b = first ? flat : rough;
    const RenderedPair all = RenderViewPair(a, b, camera, kMarch);
    const FilmFrame frame = RenderFilmFrame(a, b, camera, kMarch, 2.0f / 255);
    EXPECT_LT(Rms(frame.pair.view.color, all.view.color), kAllowedRms);
    EXPECT_LT(Rms(frame.pair.other_color, all.other_color), kAllowedRms);
  }
}

// Without tolerance only what is constant is interpolated.
TEST(FilmFrame, WithoutToleranceItIsTheExactFrame) {
  const FastGrid grid = MakeFastGrid(Smooth(7));
  const Camera camera = CameraOf(70, 50);
  const RenderedPair all = RenderViewPair(grid, grid, camera, kMarch);
  const FilmFrame frame = RenderFilmFrame(grid, grid, camera, kMarch, 0);
  EXPECT_EQ(frame.pair.view.color.pixels, all.view.color.pixels);
  EXPECT_LE(frame.rays, 70 * 50);
}

TEST(FilmFrame, SizesAndThreads) {
  const FastGrid grid = MakeFastGrid(Smooth(9));
  for (const auto& [width, height] :
       std::vector<std::pair<int, int>>{{1, 1}, {2, 2}, {3, 5}, {7, 4}, {33, 31}, {64, 65}}) {
    const Camera camera = CameraOf(width, height);
    omp_set_num_threads(1);
    const FilmFrame one = RenderFilmFrame(grid, grid, camera, kMarch, 0.01f);
    omp_set_num_threads(2);
    const FilmFrame two = RenderFilmFrame(grid, grid, camera, kMarch, 0.01f);
    EXPECT_EQ(one.rays, two.rays);
    EXPECT_EQ(one.pair.view.color.pixels, two.pair.view.color.pixels) << width;
    EXPECT_EQ(one.pair.other_color.pixels, two.pair.other_color.pixels);
    if (std::min(width, height) < 6) {
      EXPECT_EQ(one.pair.view.color.pixels,
                RenderViewPair(grid, grid, camera, kMarch).view.color.pixels);
    }
  }
}

}  // namespace
}  // namespace regrade
