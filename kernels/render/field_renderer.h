// Prepares a field of any kind for many renders on one processor.
#pragma once

#include <memory>
#include <string>

#include "kernels/device/backend.h"
#include "kernels/field/radiance_field.h"
#include "kernels/render/splat_renderer.h"
#include "kernels/render/voxel_renderer.h"
#include "kernels/scene/camera.h"

namespace regrade {

class FieldRenderer {
 public:
  // Copies what it needs. Throws Error(kResources) where the GPU's memory is too small.
  FieldRenderer(const RadianceField& field, Backend backend)
      : kind_(field.geometry->splats.on() ? MakeSplatRenderer(field, backend)
                                          : MakeVoxelRenderer(field, backend)) {}

  // Exact: single precision, every sample. A field of splats has no picture through a lens:
  // its cameras are pinholes.
  RenderedView Render(const Camera& camera) const { return kind_->Render(camera); }

  // This field's view, and the colours of another one of the same geometry on the same
  // processor; exact. The CPU marches, or sorts splats, once for both.
  RenderedPair RenderWith(const FieldRenderer& other, const Camera& camera) const {
    return kind_->RenderWith(*other.kind_, camera);
  }

  // Prepares the fast renderer: on a GPU a copy of a uniform field in half precision, or room
  // for the colours of an adaptive field's vertices. Returns why there is none, or an empty
  // text.
  std::string PrepareFast() { return kind_->PrepareFast(); }
  // Frees that memory.
  void ForgetFast() { kind_->ForgetFast(); }
  // As RenderWith; both are prepared, and the camera has no distortion.
  RenderedPair RenderFastWith(const FieldRenderer& other, const Camera& camera) const {
    return kind_->RenderFastWith(*other.kind_, camera);
  }
  // How RenderFastWith differs from RenderWith.
  std::string FastText() const { return kind_->FastText(); }

 private:
  std::unique_ptr<KindRenderer> kind_;
};

}  // namespace regrade
