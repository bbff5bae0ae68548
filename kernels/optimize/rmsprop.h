// RMSprop, the optimizer of a field's parameters.
#pragma once

namespace regrade {

inline constexpr float kUnbounded = 3e38f;

// EQ(rmsprop), as in svox2: v = g^2 at first touch, then v = beta v + (1 - beta) g^2;
// x -= rate g / (sqrt(v) + epsilon), without bias correction; untouched voxels keep value and
// state bit for bit.
struct RmspropOptions {
  float beta = 0.95f;
  float epsilon = 1e-8f;
  float rate_sh = 1e-2f;
  float rate_density = 30.0f;
  // After each step, a voxel's coefficient of degree 0 is projected into [-mean_bound,
  // mean_bound], by default a mean colour in [0, 1], and so are colours of background layers;
  // its view-dependent coefficients into [-view_bound, view_bound]. Without this, coefficients
  // hidden by the colour clamp drift, and a colour map reveals them: clamping does not commute
  // with it.
  float mean_bound = 1.77245385f;  // sqrt(pi) = 1 / (2 kSh0); kUnbounded: as published
  float view_bound = 0.2f;
  float rate_sphere_density = 3.0f;  // of the background's layers
  float rate_sphere_color = 0.1f;
};

}  // namespace regrade
