#include "stylize/field/object_weights.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/field/spherical_harmonics.h"
#include "kernels/field/trilinear.h"

namespace regrade {
namespace {

constexpr double kStep = 4294967296.0;  // weights are counted in steps of 1 / kStep

void AddTo(uint64_t* sum, uint64_t value) {
  std::atomic_ref<uint64_t>(*sum).fetch_add(value, std::memory_order_relaxed);
}

}  // namespace

MaskVote::MaskVote(const Geometry& geometry, float near_clip, const MarchOptions& march)
    : geometry_(geometry),
      weigher_(MakeRayWeigher(geometry, near_clip, march)),
      yes_(static_cast<size_t>(geometry.num_voxels())),
      all_(yes_.size()) {}

void MaskVote::Add(const Camera& camera, const Image& mask) {
  REGRADE_CHECK(mask.channels == 1 && mask.width == camera.width &&
                mask.height == camera.height);
  constexpr int kRows = 16;  // lists of samples are kept for a band only
  for (int top = 0; top < camera.height; top += kRows) {
    ViewRays rays{.cameras = {camera}};
    std::vector<double> votes;
    for (int y = top; y < std::min(top + kRows, camera.height); ++y)
      for (int x = 0; x < camera.width; ++x) {
        const float vote = *mask.at(x, y);
        if (!std::isfinite(vote)) continue;
        rays.AddPixel(0, x, y);
        votes.push_back(std::clamp(vote, 0.0f, 1.0f));
      }
    const int64_t count = rays.size();
    const RayWeights weights = weigher_->Weigh(rays);
#pragma omp parallel for schedule(dynamic, 64)
    for (int64_t r = 0; r < count; ++r)
      for (int64_t i = weights.first[r]; i < weights.first[static_cast<size_t>(r) + 1]; ++i) {
        const WeightedSample& sample = weights.samples[i];
        if (sample.on_sphere()) continue;
        int32_t voxels[8];
        CornerPoints(geometry_, sample, voxels);
        for (int corner = 0; corner < 8; ++corner) {
          const int32_t voxel = voxels[corner];
          if (voxel < 0) continue;
          const double weight = sample.weight * CornerWeight(sample.fraction, corner);
          const uint64_t steps = static_cast<uint64_t>(weight * kStep);
          if (steps == 0) continue;
          AddTo(&all_[voxel], steps);
          const uint64_t in_favour =
              static_cast<uint64_t>(votes[r] * static_cast<double>(steps));
          if (in_favour > 0) AddTo(&yes_[voxel], in_favour);
        }
      }
  }
}

std::vector<float> MaskVote::Weights(double threshold, double edge) const {
  const double half = std::min({edge, threshold, 1 - threshold});
  std::vector<float> weights(yes_.size(), 0.0f);
  for (size_t v = 0; v < weights.size(); ++v) {
    if (all_[v] == 0) continue;
    const double vote = static_cast<double>(yes_[v]) / static_cast<double>(all_[v]);
    const double weight = half > 0
                              ? std::clamp((vote - threshold + half) / (2 * half), 0.0, 1.0)
                              : (vote > threshold ? 1.0 : 0.0);
    weights[v] = static_cast<float>(weight);
  }
  return weights;
}

RadianceField WeightField(const RadianceField& field, const std::vector<float>& weights) {
  REGRADE_CHECK_EQ(std::ssize(weights), field.geometry->num_voxels());
  RadianceField result;
  result.geometry = field.geometry;
  result.near_clip = field.near_clip;
  result.march = field.march;
  result.appearance.basis = 1;
  result.appearance.sh.Resize(std::ssize(weights) * 3);
  for (size_t v = 0; v < weights.size(); ++v)
    for (size_t c = 0; c < 3; ++c)
      result.appearance.sh[static_cast<int64_t>(3 * v + c)] =
          static_cast<float>((weights[v] - 0.5) / kSh0);
  return result;
}

}  // namespace regrade
