// How a ray is marched through voxels.
#pragma once

namespace regrade {

struct MarchOptions {
  float step = 0.5f;                 // voxels
  float stop_transmittance = 1e-4f;  // a ray ends below it; bounds the lost light per channel
};

}  // namespace regrade
