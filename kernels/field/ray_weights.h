// Sample weights of rays. The geometry is frozen during style training, so a ray's weights are
// constants: they are marched on density alone and stored as lists, which are the only ray data
// that LipRF's second stage needs.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/base/view.h"
#include "kernels/field/radiance_field.h"
#include "kernels/field/ray_march.h"

namespace regrade {

// A sample of the box, or of a background sphere if `vertex` is negative; or a splat.
struct WeightedSample {
  int32_t vertex;  // lowest corner of the sample's cell, linear index into links; a splat; of
                   // a sphere ~((x R + y) L + layer), see TexelCell
  Vec3f fraction;  // trilinear fractions within the cell; bilinear, z = 0, on a sphere; 0 of
                   // splats
  float weight;    // w_i of EQ(composite)

  bool on_sphere() const { return vertex < 0; }
};

// The points a sample blends with CornerWeight(fraction, k), k = 0..7. Points number the voxels
// first and then the texels of the spheres; -1 if nothing is stored. A splat is one point, k =
// 0.
void CornerPoints(const Geometry& geometry, const WeightedSample& sample, int32_t* point);

// Lists for a batch of rays, concatenated in the rays' order.
struct RayWeights {
  std::vector<int64_t> first;  // [rays + 1]: samples of ray r are first[r] .. first[r + 1] - 1
  std::vector<WeightedSample> samples;  // front to back; zero weights are left out
  std::vector<float> transmittance;     // [rays]: behind the last sample
  // [samples]: unit directions from which splats are seen; empty where the ray's own counts.
  std::vector<Vec3f> directions;

  int64_t num_rays() const { return static_cast<int64_t>(transmittance.size()); }
};

// Exact for min_weight = 0. Samples with 0 < w <= min_weight are dropped, with an error of at
// most their sum per channel. `near_clip` in world units. Parallel over rays; the result does
// not depend on the number of threads.
RayWeights ComputeRayWeights(const Geometry& geometry, View<const Ray> rays,
                             const MarchOptions& options, float near_clip,
                             float min_weight = 0.0f);

}  // namespace regrade
