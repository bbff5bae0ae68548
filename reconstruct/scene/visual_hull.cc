#include "reconstruct/scene/visual_hull.h"

#include <algorithm>

namespace regrade {
namespace {

constexpr int kSide = 96;
constexpr float kOpaque = 0.02f;  // alpha above which a pixel belongs to the object
constexpr int kBlock = 8;         // pixels: silhouettes are stored in blocks

// Blocks of a silhouette that contain a pixel of the object, dilated by one.
struct Blocks {
  Camera camera;  // in the field's frame
  int columns, rows;
  std::vector<uint8_t> object;

  Blocks(const Camera& from, const Image& alpha)
      : camera(from),
        columns((alpha.width + kBlock - 1) / kBlock),
        rows((alpha.height + kBlock - 1) / kBlock),
        object(static_cast<size_t>(columns) * rows) {
    for (int y = 0; y < alpha.height; ++y)
      for (int x = 0; x < alpha.width; ++x) {
        if (!(*alpha.at(x, y) > kOpaque)) continue;
        const int bx = x / kBlock, by = y / kBlock;
        for (int j = std::max(by - 1, 0); j <= std::min(by + 1, rows - 1); ++j)
          for (int i = std::max(bx - 1, 0); i <= std::min(bx + 1, columns - 1); ++i)
            object[static_cast<size_t>(j) * columns + i] = 1;
      }
  }

  enum class Coverage { kOutside, kInside, kUnseen };
  Coverage At(const Vec3d& point) const {
    double u, v;
    if (!camera.Project(point, &u, &v)) return Coverage::kUnseen;
    if (!(u >= 0 && u < camera.width && v >= 0 && v < camera.height)) return Coverage::kUnseen;
    const size_t block =
        static_cast<size_t>(v / kBlock) * columns + static_cast<size_t>(u / kBlock);
    return object[block] != 0 ? Coverage::kInside : Coverage::kOutside;
  }
};

// True if the point is inside all silhouettes of views that see it, and at least half of the
// views see it: points outside of all pictures are not part of the object.
bool InHull(const std::vector<Blocks>& views, const Vec3d& point) {
  size_t inside = 0;
  for (const Blocks& view : views) {
    const Blocks::Coverage coverage = view.At(point);
    if (coverage == Blocks::Coverage::kOutside) return false;
    inside += coverage == Blocks::Coverage::kInside;
  }
  return 2 * inside >= views.size();
}

}  // namespace

NormalizedScene TightenToSilhouettes(const NormalizedScene& scene,
                                     const std::vector<Silhouette>& silhouettes) {
  std::vector<Blocks> views;
  for (const Silhouette& silhouette : silhouettes)
    views.emplace_back(silhouette.camera.Transformed(scene.field_from_world), silhouette.alpha);
  Vec3d low{1e9, 1e9, 1e9}, high{-1e9, -1e9, -1e9};
  const Vec3d radius = scene.box.radius.Cast<double>();
  for (int i = 0; i < kSide; ++i)
    for (int j = 0; j < kSide; ++j)
      for (int k = 0; k < kSide; ++k) {
        Vec3d p;
        for (int a = 0; a < 3; ++a)
          p[a] = radius[a] * (2.0 * (a == 0 ? i : a == 1 ? j : k) / (kSide - 1) - 1);
        if (!InHull(views, p)) continue;
        for (int a = 0; a < 3; ++a) {
          low[a] = std::min(low[a], p[a]);
          high[a] = std::max(high[a], p[a]);
        }
      }
  if (!(low.x <= high.x)) return scene;
  NormalizedScene result = scene;
  Vec3d half;
  double longest = 0;
  for (int a = 0; a < 3; ++a) {
    half[a] = 0.5 * (high[a] - low[a]) + 2 * radius[a] / (kSide - 1);
    longest = std::max(longest, half[a]);
  }
  Similarity& s = result.field_from_world;
  s.scale /= longest;
  s.translation = (s.translation - (low + high) * 0.5) / longest;
  for (int a = 0; a < 3; ++a) result.box.radius[a] = static_cast<float>(half[a] / longest);
  result.box.near_clip = static_cast<float>(scene.box.near_clip / longest);
  result.notice = "";
  return result;
}

}  // namespace regrade
