#include "pipeline/fields/field_renderer.h"

#include "kernels/base/error.h"
#include "kernels/field/cpu/render_film.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/field/cuda/device_rays.h"

namespace regrade {

FieldRenderer::FieldRenderer(const RadianceField& field, Backend backend)
    : backend_(backend), march_{field.step}, grid_(MakeFastGrid(field)) {
  if (backend == Backend::kCpu) return;
  device_ = UploadGrid(grid_);
  grid_ = FastGrid();
}

RenderedView FieldRenderer::Render(const Camera& camera) const {
  return backend_ == Backend::kCuda ? RenderViewOnDevice(device_, camera, march_)
                                    : RenderView(grid_, camera, march_);
}

RenderedPair FieldRenderer::RenderWith(const FieldRenderer& other, const Camera& camera) const {
  REGRADE_CHECK(backend_ == other.backend_);
  if (backend_ == Backend::kCpu) return RenderViewPair(grid_, other.grid_, camera, march_);
  return {Render(camera), other.Render(camera).color};
}

std::string FieldRenderer::PrepareFast() {
  if (backend_ == Backend::kCpu) return "";
  try {
    if (device_.cells.on())
      colors_ = MakeVertexColors(device_);
    else
      half_ = MakeHalfGrid(device_);
  } catch (const Error& error) {
    if (error.code() != ExitCode::kResources) throw;
    return "the GPU has no memory for the fast renderer's copy of the field";
  }
  return half_.empty() && colors_.empty() ? "the fast renderer needs colours of degree 2" : "";
}

RenderedPair FieldRenderer::RenderFastWith(const FieldRenderer& other,
                                           const Camera& camera) const {
  REGRADE_CHECK(backend_ == other.backend_ && camera.lens == LensModel::kPinhole);
  if (backend_ == Backend::kCuda) return {RenderFast(camera), other.RenderFast(camera).color};
  return RenderFilmFrame(grid_, other.grid_, camera, {march_.step, kFastStop}, kSmoothTolerance)
      .pair;
}

RenderedView FieldRenderer::RenderFast(const Camera& camera) const {
  REGRADE_CHECK(!half_.empty() || !colors_.empty());
  return RenderViewOnDevice(
      device_, camera, {march_.step, kFastStop},
      {.opacity_step = kFastOpacityStep, .half = &half_, .colors = &colors_});
}

}  // namespace regrade
