// Renders one kind of field on one processor; see FieldRenderer, which owns one.
#pragma once

#include "kernels/field/cpu/render_view.h"
#include "kernels/scene/camera.h"

namespace regrade {

class KindRenderer {
 public:
  virtual ~KindRenderer() = default;
  virtual RenderedView Render(const Camera& camera) const = 0;
  virtual RenderedPair RenderWith(const KindRenderer& other, const Camera& camera) const = 0;
};

}  // namespace regrade
