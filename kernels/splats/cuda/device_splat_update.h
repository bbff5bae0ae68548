// Optimizer steps and changes of the population of splats on a CUDA device; see
// kernels/splats/splat_update.h.
#pragma once

#include "kernels/splats/cuda/device_splat_renderer.h"
#include "kernels/splats/cuda/device_splats.h"
#include "kernels/splats/population_change.h"
#include "kernels/splats/splat_update.h"

namespace regrade {

struct DeviceSplatMoments {
  DeviceSplats value, first, second;  // of the same count, capacity and basis

  void Reserve(int64_t capacity);
  SplatMoments pointers() const;
};

// Steps all splats: by their gradients those that were seen, by zeros the others. `rejected`
// [1] in device memory counts gradients that are not finite.
void UpdateSplats(const SplatUpdate& update, const SplatSumsView& gradients,
                  const DeviceSplatMoments& splats, uint32_t* rejected);

// ApplyChange of values and moments. Throws Error(kResources).
void ApplyChangeOnDevice(const PopulationChange& change, DeviceSplatMoments* splats);

}  // namespace regrade
