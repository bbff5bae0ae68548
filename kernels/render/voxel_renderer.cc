#include "kernels/render/voxel_renderer.h"

#include <utility>

#include "kernels/base/error.h"
#include "kernels/field/cuda/device_grid.h"
#include "kernels/field/cuda/device_rays.h"
#include "kernels/field/packed_grid.h"

namespace regrade {
namespace {

class VoxelRenderer : public KindRenderer {
 public:
  VoxelRenderer(const RadianceField& field, Backend backend)
      : backend_(backend), march_(field.march), grid_(MakeFastGrid(field)) {
    if (backend == Backend::kCpu) return;
    device_ = UploadGrid(grid_);
    grid_ = FastGrid();
  }

  RenderedView Render(const Camera& camera) const override {
    return backend_ == Backend::kCuda ? RenderViewOnDevice(device_, camera, march_)
                                      : RenderView(grid_, camera, march_);
  }

  RenderedPair RenderWith(const KindRenderer& other, const Camera& camera) const override {
    if (backend_ == Backend::kCpu)
      return RenderViewPair(grid_, Same(other).grid_, camera, march_);
    return {Render(camera), other.Render(camera).color};
  }

 private:
  const VoxelRenderer& Same(const KindRenderer& other) const {
    const auto& same = dynamic_cast<const VoxelRenderer&>(other);
    REGRADE_CHECK(backend_ == same.backend_);
    return same;
  }

  Backend backend_;
  MarchOptions march_;
  FastGrid grid_;  // one of the two
  DeviceGrid device_;
};

}  // namespace

std::unique_ptr<KindRenderer> MakeVoxelRenderer(const RadianceField& field, Backend backend) {
  return std::make_unique<VoxelRenderer>(field, backend);
}

std::unique_ptr<KindRenderer> TakeVoxels(RadianceField&& field, Backend backend) {
  const RadianceField taken = std::move(field);
  return MakeVoxelRenderer(taken, backend);
}

}  // namespace regrade
