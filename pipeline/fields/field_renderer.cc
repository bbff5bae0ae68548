#include "pipeline/fields/field_renderer.h"

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

}  // namespace regrade
