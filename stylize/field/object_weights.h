// Object weights of a field's voxels, or splats, by a vote of masks of photos that need not
// agree.
//
// EQ(mask-vote): v_j = sum_r m_r W_rj / sum_r W_rj over the rays r of all masked photos, m_r
// what the mask says of the ray's pixel and W_rj = sum_i w_i b_ij the weight with which the ray
// sees voxel j (for w_i see EQ(composite), for b_ij see EQ(trilinear); of splat j W_rj is w_j
// of EQ(splat-composite)). The object weight is
//   e_j = clamp((v_j - t + h) / (2 h), 0, 1),  h <= t and h <= 1 - t:
// t the vote at which the weight is 1/2, h half the width of the edge. A voxel that no mask
// votes for has v_j = 0 and so e_j = 0, exactly, as does one that only a few wrong masks hit; a
// voxel that no ray sees has e_j = 0.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/field/ray_march.h"
#include "kernels/render/ray_weigher.h"
#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"

namespace regrade {

class MaskVote {
 public:
  MaskVote(const Geometry& geometry, float near_clip, const MarchOptions& march);

  // `mask` [H, W, 1] of the camera's size, in [0, 1]; pixels that are not finite do not vote.
  // Votes are counted in integers: the same for any order of views and any number of threads.
  void Add(const Camera& camera, const Image& mask);

  // [voxels]. `threshold` in (0, 1); `edge` is cut to what fits beside it.
  std::vector<float> Weights(double threshold, double edge) const;

 private:
  const Geometry& geometry_;
  std::unique_ptr<RayWeigher> weigher_;
  std::vector<uint64_t> yes_, all_;  // of weights in steps of 2^-32
};

// A field that renders, in each channel, how much of what a pixel sees is of the object.
RadianceField WeightField(const RadianceField& field, const std::vector<float>& weights);

}  // namespace regrade
