#include "tests/support/edit_truth.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "kernels/synthetic/ray_trace.h"
#include "kernels/synthetic/synthetic_scene.h"
#include "pipeline/capture/synth_grade.h"
#include "stylize/linear_map.h"

namespace regrade::testing {
namespace {

constexpr float kStep = 2.0f / 255;  // a pixel that changes more is of the region
constexpr int kNear = 10;            // pixels

bool Changes(const Image& before, const Image& after, int x, int y) {
  for (int c = 0; c < 3; ++c)
    if (std::abs(after.at(x, y)[c] - before.at(x, y)[c]) > kStep) return true;
  return false;
}

std::vector<int> PartsOf(const Image& before, const Image& after) {
  const int width = before.width, height = before.height;
  std::vector<int> parts(static_cast<size_t>(before.num_pixels()), 2);
  const auto part = [&](int x, int y) -> int& {
    return parts[static_cast<size_t>(y * width + x)];
  };
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      if (!Changes(before, after, x, y)) continue;
      for (int v = std::max(0, y - kNear); v <= std::min(height - 1, y + kNear); ++v)
        for (int u = std::max(0, x - kNear); u <= std::min(width - 1, x + kNear); ++u)
          if ((u - x) * (u - x) + (v - y) * (v - y) < kNear * kNear && part(u, v) == 2)
            part(u, v) = 0;
      part(x, y) = 1;
    }
  return parts;
}

Vec3d ColorAt(const Image& image, int64_t i) {
  const float* p = &image.pixels[static_cast<size_t>(3 * i)];
  return {p[0], p[1], p[2]};
}

// The depth of each view, computed once for all grades.
const std::vector<Image>& DepthsOf(const SyntheticScene& scene,
                                   const std::vector<Camera>& cameras) {
  static std::map<std::array<int, 3>, std::vector<Image>> known;
  std::vector<Image>& depths =
      known[{static_cast<int>(cameras.size()), cameras[0].width, cameras[0].height}];
  if (depths.empty())
    for (const Camera& camera : cameras)
      depths.push_back(RenderSyntheticView(scene, camera).depth);
  return depths;
}

}  // namespace

EditTruth::EditTruth(const std::string& grade, std::vector<Image> renders, int edited)
    : edited_(edited), renders_(std::move(renders)), graded_(renders_) {
  const SyntheticScene scene = MakeSyntheticScene("table", 0);
  const int count = static_cast<int>(renders_.size());
  const std::vector<Camera> cameras =
      SyntheticCameras(scene, count, renders_[0].width, renders_[0].height);
  const std::vector<Image>& depths = DepthsOf(scene, cameras);
  const auto ball = std::ranges::find(scene.solids, Shape::kSphere, &Solid::shape);
  for (size_t i = 0; i < renders_.size(); ++i) {
    ApplyGrade(ParseSynthGrade(grade), scene, cameras[i], depths[i],
               static_cast<int>(ball - scene.solids.begin()), &graded_[i]);
    parts_.push_back(PartsOf(renders_[i], graded_[i]));
  }
}

EditErrors EditTruth::ErrorsOf(const std::vector<Image>& pictures) const {
  EditErrors errors;
  double inside = 0, outside = 0;
  for (size_t i = 0; i < pictures.size(); ++i) {
    if (static_cast<int>(i) == edited_) continue;
    for (int64_t k = 0; k < pictures[i].num_pixels(); ++k) {
      const Vec3d error = ColorAt(pictures[i], k) - ColorAt(graded_[i], k);
      const int part = parts_[i][static_cast<size_t>(k)];
      if (part == 1) {
        errors.inside += Dot(error, error);
        inside += 3;
      } else if (part == 2) {
        errors.outside += std::abs(error.x) + std::abs(error.y) + std::abs(error.z);
        outside += 3;
      }
    }
  }
  errors.inside /= std::max(1.0, inside);
  errors.outside /= std::max(1.0, outside);
  return errors;
}

std::vector<Image> EditTruth::ByLinearMap() const {
  LeastSquaresAccumulator accumulator;
  for (size_t i = 0; i < renders_.size(); ++i)
    for (int64_t k = 0; static_cast<int>(i) != edited_ && k < renders_[i].num_pixels(); ++k)
      accumulator.Add(ColorAt(renders_[i], k), ColorAt(graded_[i], k));
  const ColorMap map = accumulator.Solve();
  std::vector<Image> mapped = renders_;
  for (Image& picture : mapped)
    for (int64_t k = 0; k < picture.num_pixels(); ++k) {
      const Vec3d color = map(ColorAt(picture, k));
      for (int c = 0; c < 3; ++c)
        picture.pixels[static_cast<size_t>(3 * k + c)] =
            static_cast<float>(std::clamp(color[c], 0.0, 1.0));
    }
  return mapped;
}

}  // namespace regrade::testing
