// A field restyled from training targets: scene-wide map, background, training, network
// applied.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "kernels/device/backend.h"
#include "kernels/field/radiance_field.h"
#include "kernels/render/ray_weigher.h"
#include "stylize/training/train_network.h"
#include "stylize/training/training_targets.h"

namespace regrade {

// The least harmonics a channel of a restyled field: a 2D method that maps each view by itself
// needs directions, also where the scene's own colours have none. See PadShBasis.
inline constexpr int kStyledBasis = 9;

struct RestyleRequest {
  TrainNetworkOptions options;
  Backend backend = Backend::kCpu;
  // Object weights [voxels], see MixFields; null restyles the whole scene. An object's style
  // leaves the background as it is.
  const std::vector<float>* object_weights = nullptr;
  const TrainingState* resume = nullptr;  // see TrainNetwork
};

struct RestyledField {
  RadianceField source;  // padded to kStyledBasis
  RadianceField styled;
  TrainNetworkResult trained;
  std::vector<std::string> notices;  // of the scene-wide map
};

struct RestyleHooks {
  TrainingHooks training;  // its progress is that of all parts
  // Called at the end with a weigher of the field, of min_weight 0, which knows the views.
  std::function<void(const RestyledField&, RayWeigher*)> check;
};

// `targets` must not be empty. Throws what TrainNetwork throws, and Error(kResources) where
// kCuda is asked for and not there.
RestyledField Restyle(RadianceField field, const TrainingTargets& targets,
                      const RestyleRequest& request, const RestyleHooks& hooks);

}  // namespace regrade
