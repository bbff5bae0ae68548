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
  if (device_.cells.on()) return "the fast renderer needs a uniform field";
  try {
    half_ = MakeHalfGrid(device_);
  } catch (const Error& error) {
    if (error.code() != ExitCode::kResources) throw;
    return "the GPU has no memory for a copy of the field in half precision";
  }
  return half_.empty() ? "the fast renderer needs colours of degree 2" : "";
}

RenderedPair FieldRenderer::RenderFastWith(const FieldRenderer& other,
                                           const Camera& camera) const {
  REGRADE_CHECK(backend_ == other.backend_ && camera.lens == LensModel::kPinhole);
  if (backend_ == Backend::kCuda) return {RenderHalf(camera), other.RenderHalf(camera).color};
  return RenderFilmFrame(grid_, other.grid_, camera, {march_.step, kFastStop}, kSmoothTolerance)
      .pair;
}

RenderedView FieldRenderer::RenderHalf(const Camera& camera) const {
  REGRADE_CHECK(!half_.empty());
  return RenderViewOnDevice(device_, camera, {march_.step, kFastStop}, kFastOpacityStep,
                            &half_);
}

}  // namespace regrade
