#include "pipeline/page/coarse_field.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/field/cell_lattice.h"

namespace regrade {
namespace {

// Less than this optical depth across a coarse voxel is left out.
constexpr double kLeastDepth = 0.01;

// Sums over what lies in each coarse voxel: density times volume, and that times colours.
class Sums {
 public:
  // `width`: of a coarse voxel, a power of two of the field's voxels.
  Sums(const Vec3i& voxels, int width) : width_(width) {
    for (int a = 0; a < 3; ++a) size_[a] = std::max(2, (voxels[a] + width - 1) / width);
    sum_.resize(static_cast<size_t>(size_.x) * static_cast<size_t>(size_.y) *
                static_cast<size_t>(size_.z));
  }

  // A cube of the field, `side` voxels wide: it is in one coarse voxel or fills some.
  void Add(const Vec3i& low, int side, double density, const Vec3d& color) {
    const int count = std::max(1, side / width_);
    const double volume = std::pow(std::min(side, width_), 3);
    for (int k = 0; k < count * count * count; ++k) {
      const Vec3i at{low.x / width_ + k / (count * count), low.y / width_ + k / count % count,
                     low.z / width_ + k % count};
      Sum& sum = sum_[Index(at)];
      sum.density += static_cast<float>(density * volume);
      for (int c = 0; c < 3; ++c)
        sum.color[c] += static_cast<float>(density * volume * color[c]);
    }
  }
  const Vec3i& size() const { return size_; }
  int width() const { return width_; }
  double Density(size_t i) const { return double{sum_[i].density} / std::pow(width_, 3); }
  Vec3f Color(size_t i) const { return sum_[i].color / sum_[i].density; }
  size_t count() const { return sum_.size(); }

 private:
  struct Sum {
    float density = 0;
    Vec3f color{0, 0, 0};
  };
  size_t Index(const Vec3i& at) const {
    return (static_cast<size_t>(at.x) * static_cast<size_t>(size_.y) +
            static_cast<size_t>(at.y)) *
               static_cast<size_t>(size_.z) +
           static_cast<size_t>(at.z);
  }

  int width_;
  Vec3i size_;
  std::vector<Sum> sum_;
};

// Densities times colours of some voxels, to average.
struct Mean {
  double density = 0;
  Vec3d color{};

  void Add(const RadianceField& field, int64_t voxel) {
    const double own = std::max(0.0, double{field.geometry->density[voxel]});
    const float* const sh = field.appearance.sh.data() + voxel * field.appearance.stride();
    density += own;
    for (int c = 0; c < 3; ++c) color[c] += own * double{sh[c * field.appearance.basis]};
  }
};

void AddCells(const RadianceField& field, Sums* sums) {
  const CellGrid& cells = field.geometry->cells;
  for (int64_t i = 0; i < cells.num_cells(); ++i) {
    Mean mean;
    for (int k = 0; k < 8; ++k) mean.Add(field, cells.corner[8 * i + k]);
    if (mean.density > 0)
      sums->Add(PlaceOf(cells.key[i]), 1 << (cells.finest - cells.level[i]), mean.density / 8,
                mean.color / mean.density);
  }
}

void AddGrid(const RadianceField& field, Sums* sums) {
  const Geometry& geometry = *field.geometry;
  const Vec3i& size = geometry.frame.resolution;
  for (int x = 0; x < size.x; ++x)
    for (int y = 0; y < size.y; ++y)
      for (int z = 0; z < size.z; ++z) {
        const int32_t voxel = geometry.links[geometry.frame.Vertex(x, y, z)];
        Mean mean;
        if (voxel >= 0) mean.Add(field, voxel);
        if (mean.density > 0)
          sums->Add({x, y, z}, 1, mean.density, mean.color / mean.density);
      }
}

// The same box with wide voxels: they may reach over its high faces.
GridFrame FrameOf(const GridFrame& fine, const Sums& sums) {
  GridFrame frame = fine;
  frame.resolution = sums.size();
  for (int a = 0; a < 3; ++a) {
    const float low = fine.center[a] - fine.radius[a];
    frame.radius[a] = fine.radius[a] * static_cast<float>(sums.size()[a] * sums.width()) /
                      static_cast<float>(fine.resolution[a]);
    frame.center[a] = low + frame.radius[a];
  }
  return frame;
}

std::optional<RadianceField> FieldOf(const RadianceField& fine, const Sums& sums,
                                     int64_t most_voxels) {
  auto geometry = std::make_shared<Geometry>();
  geometry->frame = FrameOf(fine.geometry->frame, sums);
  const Vec3f scale = geometry->frame.Scale();
  const double width = 1 / double{std::max({scale.x, scale.y, scale.z})};
  std::vector<size_t> kept;
  geometry->links.Resize(static_cast<int64_t>(sums.count()));
  for (size_t i = 0; i < sums.count(); ++i) {
    const bool seen = sums.Density(i) * width > kLeastDepth;
    geometry->links[static_cast<int64_t>(i)] = seen ? static_cast<int32_t>(kept.size()) : -1;
    if (seen) kept.push_back(i);
  }
  const auto n = static_cast<int64_t>(kept.size());
  if (n == 0 || n > most_voxels) return std::nullopt;
  RadianceField field;
  field.appearance.basis = 1;
  geometry->density.Resize(n);
  field.appearance.sh.Resize(3 * n);
  for (int64_t v = 0; v < n; ++v) {
    geometry->density[v] = static_cast<float>(sums.Density(kept[static_cast<size_t>(v)]));
    const Vec3f color = sums.Color(kept[static_cast<size_t>(v)]);
    for (int c = 0; c < 3; ++c) field.appearance.sh[3 * v + c] = color[c];
  }
  field.geometry = std::move(geometry);
  field.background = fine.background;
  field.near_clip = fine.near_clip;
  field.step = 1;
  return field;
}

}  // namespace

std::optional<RadianceField> CoarseField(const RadianceField& field,
                                         const CoarseOptions& options) {
  const Geometry& geometry = *field.geometry;
  const int64_t most =
      std::min(options.most_voxels, geometry.num_voxels() / options.least_times);
  const Vec3i& voxels = geometry.frame.resolution;
  const int longest = std::max({voxels.x, voxels.y, voxels.z});
  for (int width = 2; width <= longest / 4; width *= 2) {
    if (longest / width > options.longest) continue;
    Sums sums(voxels, width);
    geometry.cells.on() ? AddCells(field, &sums) : AddGrid(field, &sums);
    if (std::optional<RadianceField> coarse = FieldOf(field, sums, most)) return coarse;
  }
  return std::nullopt;
}

}  // namespace regrade
