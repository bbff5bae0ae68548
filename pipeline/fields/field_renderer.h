// Prepares a field for many renders on the processor of the run.
#pragma once

#include "kernels/device/backend.h"
#include "kernels/field/cuda/device_grid.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/ray_march.h"
#include "kernels/field/render.h"

namespace regrade {

class FieldRenderer {
 public:
  // Throws Error(kResources) where the GPU's memory is too small for the field.
  FieldRenderer(const RadianceField& field, Backend backend);
  RenderedView Render(const Camera& camera) const;

 private:
  Backend backend_;
  MarchOptions march_;
  FastGrid grid_;  // one of the two
  DeviceGrid device_;
};

}  // namespace regrade
