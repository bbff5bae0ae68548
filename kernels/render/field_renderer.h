// Prepares a field of any kind for many renders on one processor.
#pragma once

#include <memory>
#include <string>

#include "kernels/device/backend.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/field/radiance_field.h"
#include "kernels/field/render.h"
#include "kernels/scene/camera.h"

namespace regrade {

// Of the fast renderers of voxels: the transmittance at which a ray ends; on a GPU the step of
// opacity at which a colour of a uniform field is evaluated, see EQ(opacity-steps); on the CPU
// the tolerance of EQ(smooth-pixels). Errors and times are in COSTS.md.
inline constexpr float kFastStop = 1e-3f, kFastOpacityStep = 1.0f / 128,
                       kSmoothTolerance = 1.5f / 255;
inline constexpr char kFastRendererOfGpu[] =
    "a uniform field in half precision, steps where opacity changes by 1/128; of an adaptive "
    "field, colours of vertices; at least 55 dB from the exact frames";
inline constexpr char kFastRendererOfCpu[] =
    "smooth parts interpolated between rays; at least 55 dB from the exact frames";

// What renders one kind of field; see FieldRenderer, which has one of two.
class KindRenderer {
 public:
  virtual ~KindRenderer() = default;
  virtual RenderedView Render(const Camera& camera) const = 0;
  virtual RenderedPair RenderWith(const KindRenderer& other, const Camera& camera) const = 0;
  virtual std::string PrepareFast() = 0;
  virtual void ForgetFast() = 0;
  virtual RenderedPair RenderFastWith(const KindRenderer& other,
                                      const Camera& camera) const = 0;
  virtual std::string FastText() const = 0;
};

std::unique_ptr<KindRenderer> MakeVoxelRenderer(const RadianceField& field, Backend backend);
std::unique_ptr<KindRenderer> MakeSplatRenderer(const RadianceField& field, Backend backend);

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
