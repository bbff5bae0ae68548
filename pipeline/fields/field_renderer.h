// Prepares a field for many renders on the processor of the run.
#pragma once

#include <string>

#include "kernels/device/backend.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/field/cuda/device_grid.h"
#include "kernels/field/cuda/device_rays.h"
#include "kernels/field/cuda/half_grid.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/ray_march.h"
#include "kernels/field/render.h"

namespace regrade {

// Of the fast renderers: the transmittance at which a ray ends; on a GPU the step of opacity at
// which a colour of a uniform field is evaluated, see EQ(opacity-steps); on the CPU the
// tolerance of EQ(smooth-pixels). Errors and times are in COSTS.md.
inline constexpr float kFastStop = 1e-3f, kFastOpacityStep = 1.0f / 128,
                       kSmoothTolerance = 1.5f / 255;
inline constexpr char kFastRendererOfGpu[] =
    "a uniform field in half precision, steps where opacity changes by 1/128; of an adaptive "
    "field, colours of vertices; at least 55 dB from the exact frames";
inline constexpr char kFastRendererOfCpu[] =
    "smooth parts interpolated between rays; at least 55 dB from the exact frames";

class FieldRenderer {
 public:
  // Throws Error(kResources) where the GPU's memory is too small for the field.
  FieldRenderer(const RadianceField& field, Backend backend);
  // Exact: single precision, every sample.
  RenderedView Render(const Camera& camera) const;

  // This field's view, and the colours of another one of the same geometry on the same
  // processor; exact. The CPU marches once for both.
  RenderedPair RenderWith(const FieldRenderer& other, const Camera& camera) const;

  // Prepares the fast renderer: on a GPU a copy of a uniform field in half precision, or room
  // for the colours of an adaptive field's vertices. Returns why there is none, or an empty
  // text.
  std::string PrepareFast();
  // Frees that memory.
  void ForgetFast() { half_ = {}, colors_ = {}; }
  // As RenderWith; both are prepared, and the camera has no distortion.
  RenderedPair RenderFastWith(const FieldRenderer& other, const Camera& camera) const;

 private:
  RenderedView RenderFast(const Camera& camera) const;

  Backend backend_;
  MarchOptions march_;
  FastGrid grid_;  // one of the two
  DeviceGrid device_;
  HalfGrid half_;
  VertexColors colors_;
};

}  // namespace regrade
