#include "pipeline/page/coarse_field.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <vector>

namespace regrade {
namespace {

// Less than this optical depth across a coarse voxel is left out.
constexpr double kLeastDepth = 0.01;

// Sums over the voxels in each coarse voxel: of densities, and of densities times colours.
class Sums {
 public:
  // `width`: of a coarse voxel, a power of two of the field's voxels.
  Sums(const Vec3i& voxels, int width) : width_(width) {
    for (int a = 0; a < 3; ++a) size_[a] = std::max(2, (voxels[a] + width - 1) / width);
    sum_.resize(static_cast<size_t>(size_.x) * static_cast<size_t>(size_.y) *
                static_cast<size_t>(size_.z));
  }

  // A voxel of the field.
  void Add(const Vec3i& at, double density, const Vec3d& color) {
    Sum& sum = sum_[Index({at.x / width_, at.y / width_, at.z / width_})];
    sum.density += static_cast<float>(density);
    for (int c = 0; c < 3; ++c) sum.color[c] += static_cast<float>(density * color[c]);
  }
  const Vec3i& size() const { return size_; }
  int width() const { return width_; }
  double Density(size_t i) const { return double{sum_[i].density} / std::pow(width_, 3); }
  Vec3d Color(size_t i) const { return (sum_[i].color / sum_[i].density).Cast<double>(); }
  size_t count() const { return sum_.size(); }
  bool Has(const Vec3i& at) const {
    for (int a = 0; a < 3; ++a)
      if (at[a] < 0 || at[a] >= size_[a]) return false;
    return true;
  }
  Vec3i At(size_t i) const {
    const int n = static_cast<int>(i);
    return {n / size_.z / size_.y, n / size_.z % size_.y, n % size_.z};
  }
  size_t Index(const Vec3i& at) const {
    return (static_cast<size_t>(at.x) * static_cast<size_t>(size_.y) +
            static_cast<size_t>(at.y)) *
               static_cast<size_t>(size_.z) +
           static_cast<size_t>(at.z);
  }

 private:
  struct Sum {
    float density = 0;
    Vec3f color{0, 0, 0};
  };

  int width_;
  Vec3i size_;
  std::vector<Sum> sum_;
};

// Densities times colours of some voxels, to average.
struct Mean {
  double density = 0;
  Vec3d color{};
};

void AddGrid(const RadianceField& field, Sums* sums) {
  const Geometry& geometry = *field.geometry;
  const Vec3i& size = geometry.frame.resolution;
  for (int x = 0; x < size.x; ++x)
    for (int y = 0; y < size.y; ++y)
      for (int z = 0; z < size.z; ++z) {
        const int32_t voxel = geometry.links[geometry.frame.Vertex(x, y, z)];
        if (voxel < 0 || !(geometry.density[voxel] > 0)) continue;
        const float* const sh =
            field.appearance.sh.data() + int64_t{voxel} * field.appearance.stride();
        const int basis = field.appearance.basis;
        sums->Add({x, y, z}, double{geometry.density[voxel]},
                  {double{sh[0]}, double{sh[basis]}, double{sh[2 * basis]}});
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

// What is around the places of `seen`: empty, with the colours of what it touches, so that a
// surface keeps its colour up to where it ends.
std::map<size_t, Mean> Rim(const Sums& sums, const std::vector<size_t>& seen) {
  std::map<size_t, Mean> rim;
  const std::set<size_t> inside(seen.begin(), seen.end());
  for (const size_t i : seen)
    for (int k = 0; k < 27; ++k) {
      const Vec3i at = sums.At(i) + Vec3i{k / 9 - 1, k / 3 % 3 - 1, k % 3 - 1};
      if (!sums.Has(at) || inside.contains(sums.Index(at))) continue;
      Mean& mean = rim[sums.Index(at)];
      mean.density += sums.Density(i);
      mean.color += sums.Density(i) * sums.Color(i);
    }
  return rim;
}

std::optional<RadianceField> FieldOf(const RadianceField& fine, const Sums& sums,
                                     int64_t most_voxels) {
  auto geometry = std::make_shared<Geometry>();
  geometry->frame = FrameOf(fine.geometry->frame, sums);
  const Vec3f scale = geometry->frame.Scale();
  const double width = 1 / double{std::max({scale.x, scale.y, scale.z})};
  std::vector<size_t> seen;
  for (size_t i = 0; i < sums.count(); ++i)
    if (sums.Density(i) * width > kLeastDepth) seen.push_back(i);
  if (seen.empty() || std::ssize(seen) > most_voxels) return std::nullopt;
  std::map<size_t, Mean> voxels = Rim(sums, seen);
  for (auto& [i, mean] : voxels) {
    mean.color = mean.color / mean.density;
    mean.density = 0;
  }
  for (const size_t i : seen) voxels[i] = {sums.Density(i), sums.Color(i)};
  const auto n = std::ssize(voxels);
  if (n > most_voxels) return std::nullopt;

  RadianceField field;
  field.appearance.basis = 1;
  geometry->density.Resize(n);
  field.appearance.sh.Resize(3 * n);
  geometry->links.Resize(static_cast<int64_t>(sums.count()));
  std::fill(geometry->links.begin(), geometry->links.end(), -1);
  int32_t voxel = 0;
  for (const auto& [i, mean] : voxels) {
    geometry->links[static_cast<int64_t>(i)] = voxel;
    geometry->density[voxel] = static_cast<float>(mean.density);
    for (int c = 0; c < 3; ++c)
      field.appearance.sh[3 * int64_t{voxel} + c] = static_cast<float>(mean.color[c]);
    ++voxel;
  }
  field.geometry = std::move(geometry);
  field.background = fine.background;
  field.near_clip = fine.near_clip;
  field.march.step = 1;
  return field;
}

}  // namespace

std::optional<RadianceField> CoarseField(const RadianceField& field,
                                         const CoarseOptions& options) {
  const Geometry& geometry = *field.geometry;
  const int64_t most = std::min(
      options.most_voxels,
      static_cast<int64_t>(options.most_part * static_cast<double>(geometry.num_voxels())));
  const Vec3i& voxels = geometry.frame.resolution;
  const int longest = std::max({voxels.x, voxels.y, voxels.z});
  for (int width = 2; width <= longest / 4; width *= 2) {
    if (longest / width > options.longest) continue;
    Sums sums(voxels, width);
    AddGrid(field, &sums);
    if (std::optional<RadianceField> coarse = FieldOf(field, sums, most)) return coarse;
  }
  return std::nullopt;
}

}  // namespace regrade
