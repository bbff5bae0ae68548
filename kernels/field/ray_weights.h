// The geometry is frozen while a style is learned, so a ray's sample weights are constants:
// they are marched on density alone and kept as lists. Everything LipRF's second stage needs of
// a ray is here.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/base/view.h"
#include "kernels/field/radiance_field.h"
#include "kernels/field/ray_march.h"

namespace regrade {

// One of the box, or, where `vertex` is negative, of a background sphere.
struct WeightedSample {
  int32_t vertex;  // lowest corner of the sample's cell, linear index into links; of a sphere
                   // ~((x R + y) L + layer), see TexelCell
  Vec3f fraction;  // trilinear fractions within the cell; bilinear, z = 0, on a sphere
  float weight;    // w_i of EQ(composite)

  bool on_sphere() const { return vertex < 0; }
};

// What a sample blends with CornerWeight(fraction, k), k = 0..7: points, which are first the
// voxels and then the texels of the spheres; -1 where nothing is stored.
void CornerPoints(const Geometry& geometry, const WeightedSample& sample, int32_t* point);

// Lists for a batch of rays, concatenated in the rays' order.
struct RayWeights {
  std::vector<int64_t> first;  // [rays + 1]: samples of ray r are first[r] .. first[r + 1] - 1
  std::vector<WeightedSample> samples;  // front to back; zero weights are left out
  std::vector<float> transmittance;     // [rays]: what is left behind the last sample

  int64_t num_rays() const { return static_cast<int64_t>(transmittance.size()); }
};

// Exact for min_weight = 0. Samples with 0 < w <= min_weight are dropped, an error of at most
// their sum a channel: a parameter with a price. `near_clip` in world units. Parallel over
// rays; the result does not depend on threads.
RayWeights ComputeRayWeights(const Geometry& geometry, View<const Ray> rays,
                             const MarchOptions& options, float near_clip,
                             float min_weight = 0.0f);

}  // namespace regrade
