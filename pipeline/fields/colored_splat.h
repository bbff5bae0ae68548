// One Gaussian of a file, and the arrays that they are collected in.
//
// What can be drawn: see IsUsable in kernels/splats/splats.h, and no standard deviation above
// exp(kMaxLogScale).
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "kernels/splats/rotate_harmonics.h"
#include "pipeline/fields/splat_scene.h"

namespace regrade {

struct ColoredSplat {
  Splat<float> splat;
  float sh[3 * kMaxBasis]{};  // [3, basis]: all coefficients of red first
};

ColoredSplat SplatAt(const SplatsView<float>& splats, int64_t i);

// A logit beyond this is as good as this: sigmoid(-kMostLogit) is 2e-9.
inline constexpr float kMostLogit = 20;

// The logit of an opacity that was stored in a byte; 0 and 255 count as a quarter of a step
// from the end.
float LogitOfByte(int byte);

// Limits an opacity's logit to kMostLogit and the logarithm of a standard deviation to at least
// -kMaxLogScale, both of which may be infinite (an opacity of 1, a disc), and makes a
// quaternion without a direction that of the identity. Returns whether the record can be drawn.
bool CleanRecord(int basis, ColoredSplat* record);

// The frame of a file, turned to another one.
class SplatTurn {
 public:
  // `to_from_file` is orthogonal; a reflection, too: Gaussians are symmetric.
  explicit SplatTurn(const Mat3d& to_from_file);
  void Apply(int basis, ColoredSplat* record) const;

 private:
  Mat3d matrix_;
  std::array<double, 4> quaternion_;  // of matrix_ times its determinant
  HarmonicsMatrix harmonics_;
};

// a b, both w x y z.
std::array<double, 4> QuaternionProduct(const std::array<double, 4>& a,
                                        const std::array<double, 4>& b);

class SplatCollector {
 public:
  // Memory for `records` splats of `basis` harmonics is taken at once: `records` must have been
  // compared with the size of the file. Throws Error(kInput) with `where` if there are none, or
  // if these and `file_bytes` are more than `budget` bytes.
  SplatCollector(uint64_t records, int basis, uint64_t file_bytes, uint64_t budget,
                 std::string where);

  int basis() const { return scene_.splats.basis; }
  void Add(ColoredSplat record);
  // Throws Error(kInput) if no record can be drawn.
  SplatScene Finish() &&;

 private:
  SplatScene scene_;
  std::string where_;
};

}  // namespace regrade
