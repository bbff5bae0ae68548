// Prepares a field of any kind for many renders on one processor.
#pragma once

#include <memory>
#include <utility>

#include "kernels/device/backend.h"
#include "kernels/field/radiance_field.h"
#include "kernels/render/render_kind.h"
#include "kernels/scene/camera.h"

namespace regrade {

class FieldRenderer {
 public:
  // Copies what it needs, or takes the field over where that saves a copy. Throws
  // Error(kResources) where the GPU's memory is too small.
  FieldRenderer(const RadianceField& field, Backend backend)
      : renderer_(RenderKindOf(*field.geometry).make_renderer(field, backend)) {}
  FieldRenderer(RadianceField&& field, Backend backend) {
    const RenderKind& kind = RenderKindOf(*field.geometry);
    renderer_ = kind.take_field(std::move(field), backend);
  }

  // In single precision, every sample. A field of splats has no picture through a lens:
  // its cameras are pinholes.
  RenderedView Render(const Camera& camera) const { return renderer_->Render(camera); }

  // This field's view, and the colours of another one of the same geometry on the same
  // processor. The CPU marches, or sorts splats, once for both.
  RenderedPair RenderWith(const FieldRenderer& other, const Camera& camera) const {
    return renderer_->RenderWith(*other.renderer_, camera);
  }

 private:
  std::unique_ptr<Renderer> renderer_;
};

}  // namespace regrade
