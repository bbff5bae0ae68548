#include "pipeline/fields/compressed_ply_writer.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "kernels/splats/covariance.h"
#include "pipeline/fields/gaussian_ply.h"
#include "pipeline/fields/morton_order.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/byte_packing.h"

namespace regrade {
namespace {

constexpr size_t kInChunk = 256;
constexpr float kMostWritten = 20;  // of a logarithm; PlayCanvas' limit

// What three numbers of all splats of a chunk span.
struct Span3 {
  Vec3f low, high;

  void Add(const Vec3f& v, bool first) {
    for (int a = 0; a < 3; ++a) {
      low[a] = first ? v[a] : std::min(low[a], v[a]);
      high[a] = first ? v[a] : std::max(high[a], v[a]);
    }
  }
  // In [0, 1].
  double Share(const Vec3f& v, int a) const {
    const double width = double{high[a]} - double{low[a]};
    return width > 0 ? (double{v[a]} - double{low[a]}) / width : 0;
  }
};

// `share` in [0, 1].
uint32_t ToBits(double share, int bits) {
  return static_cast<uint32_t>(std::lround(share * ((1 << bits) - 1)));
}

uint32_t PackThree(const Span3& span, const Vec3f& v) {
  return ToBits(span.Share(v, 0), 11) << 21 | ToBits(span.Share(v, 1), 10) << 11 |
         ToBits(span.Share(v, 2), 11);
}

uint32_t PackQuaternion(const float* wxyz) {
  float unit[4];
  UnitQuaternion(wxyz, unit);
  uint32_t largest = 0;
  for (uint32_t a = 1; a < 4; ++a)
    if (std::abs(unit[a]) > std::abs(unit[largest])) largest = a;
  const double sign = unit[largest] < 0 ? -1 : 1;
  uint32_t packed = largest;
  for (uint32_t a = 0; a < 4; ++a)
    if (a != largest)
      packed = packed << 10 |
               ToBits(std::clamp(sign * double{unit[a]} * std::sqrt(0.5) + 0.5, 0.0, 1.0), 10);
  return packed;
}

struct PackedSplat {
  Vec3f mean, scale, color;
  const float *quaternion, *sh;
  double opacity;
};

PackedSplat Prepared(const SplatsView<float>& splats, int64_t i) {
  const Splat<float> splat = splats[i];
  PackedSplat to{splat.mean,
                 splat.log_scale,
                 {},
                 splats.quaternion + 4 * i,
                 splats.Coefficients(i),
                 1 / (1 + std::exp(-double{splat.opacity_logit}))};
  for (int a = 0; a < 3; ++a) {
    to.scale[a] = std::clamp(to.scale[a], -kMostWritten, kMostWritten);
    to.color[a] = static_cast<float>(0.5 + kSh0 * double{to.sh[a * splats.basis]});
  }
  return to;
}

std::string HeaderOf(int64_t count, size_t chunks, int basis, const std::string& comments) {
  std::string header = "ply\nformat binary_little_endian 1.0\n" + comments;
  header += "element chunk " + std::to_string(chunks) + "\n";
  for (const auto& [prefix, letters] :
       {std::pair{"", "xyz"}, std::pair{"scale_", "xyz"}, std::pair{"", "rgb"}})
    for (const char* end : {"min_", "max_"})
      for (int a = 0; a < 3; ++a)
        header += std::string("property float ") + end + prefix + letters[a] + "\n";
  header += "element vertex " + std::to_string(count) + "\n";
  for (const char* name : {"position", "rotation", "scale", "color"})
    header += std::string("property uint packed_") + name + "\n";
  if (basis > 1) header += "element sh " + std::to_string(count) + "\n";
  for (int k = 0; k < 3 * (basis - 1); ++k)
    header += "property uchar f_rest_" + std::to_string(k) + "\n";
  return header + "end_header\n";
}

class Chunks {
 public:
  explicit Chunks(const SplatsView<float>& splats) : splats_(splats) {}

  void Add(std::span<const int64_t> indices) {
    Span3 means, scales, colors;
    std::vector<PackedSplat> chunk;
    for (const int64_t i : indices) {
      const PackedSplat splat = Prepared(splats_, i);
      means.Add(splat.mean, chunk.empty());
      scales.Add(splat.scale, chunk.empty());
      colors.Add(splat.color, chunk.empty());
      chunk.push_back(splat);
    }
    for (const Span3& span : {means, scales, colors})
      for (const Vec3f& end : {span.low, span.high})
        for (int a = 0; a < 3; ++a) bounds_.Value(end[a]);
    for (const PackedSplat& splat : chunk) {
      vertices_.Value(PackThree(means, splat.mean));
      vertices_.Value(PackQuaternion(splat.quaternion));
      vertices_.Value(PackThree(scales, splat.scale));
      uint32_t color = 0;
      for (int a = 0; a < 3; ++a) color = color << 8 | ToBits(colors.Share(splat.color, a), 8);
      vertices_.Value(color << 8 | ToBits(splat.opacity, 8));
      AddHarmonics(splat.sh);
    }
  }
  std::string Joined() const { return bounds_.Joined() + vertices_.Joined() + harmonics_; }

 private:
  void AddHarmonics(const float* sh) {
    for (int c = 0; c < 3; ++c)
      for (int k = 1; k < splats_.basis; ++k) {
        const double share = double{sh[c * splats_.basis + k]} / 8 + 0.5;
        harmonics_.push_back(static_cast<char>(
            static_cast<uint8_t>(std::clamp(std::floor(256 * share), 0.0, 255.0))));
      }
  }

  SplatsView<float> splats_;
  BytePacker bounds_, vertices_;
  std::string harmonics_;
};

}  // namespace

void WriteCompressedPly(const std::string& path, const Splats& splats, bool antialiased,
                        const std::string& comment) {
  const std::vector<int64_t> order = MortonOrder(splats.view());
  Chunks chunks(splats.view());
  for (size_t begin = 0; begin < order.size(); begin += kInChunk)
    chunks.Add(std::span(order).subspan(begin, std::min(kInChunk, order.size() - begin)));
  WriteFileAtomically(path, HeaderOf(splats.count(), (order.size() + kInChunk - 1) / kInChunk,
                                     splats.basis, CommentLines(comment, antialiased)) +
                                chunks.Joined());
}

}  // namespace regrade
