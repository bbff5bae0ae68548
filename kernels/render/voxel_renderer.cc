#include "kernels/render/voxel_renderer.h"

#include "kernels/base/error.h"
#include "kernels/field/cpu/render_film.h"
#include "kernels/field/cuda/device_grid.h"
#include "kernels/field/cuda/device_rays.h"
#include "kernels/field/cuda/half_grid.h"
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

  std::string PrepareFast() override {
    if (backend_ == Backend::kCpu) return "";
    try {
      half_ = MakeHalfGrid(device_);
    } catch (const Error& error) {
      if (error.code() != ExitCode::kResources) throw;
      return "the GPU has no memory for the fast renderer's copy of the field";
    }
    return half_.empty() ? "the fast renderer needs colours of degree 2" : "";
  }

  void ForgetFast() override { half_ = {}; }

  RenderedPair RenderFastWith(const KindRenderer& other, const Camera& camera) const override {
    REGRADE_CHECK(camera.lens == LensModel::kPinhole);
    if (backend_ == Backend::kCuda)
      return {RenderFast(camera), Same(other).RenderFast(camera).color};
    return RenderFilmFrame(grid_, Same(other).grid_, camera, {march_.step, kFastStop},
                           kSmoothTolerance)
        .pair;
  }

  std::string FastText() const override {
    return backend_ == Backend::kCuda ? kFastRendererOfGpu : kFastRendererOfCpu;
  }

 private:
  const VoxelRenderer& Same(const KindRenderer& other) const {
    const auto& same = dynamic_cast<const VoxelRenderer&>(other);
    REGRADE_CHECK(backend_ == same.backend_);
    return same;
  }

  RenderedView RenderFast(const Camera& camera) const {
    REGRADE_CHECK(!half_.empty());
    return RenderViewOnDevice(device_, camera, {march_.step, kFastStop},
                              {.opacity_step = kFastOpacityStep, .half = &half_});
  }

  Backend backend_;
  MarchOptions march_;
  FastGrid grid_;  // one of the two
  DeviceGrid device_;
  HalfGrid half_;
};

}  // namespace

std::unique_ptr<KindRenderer> MakeVoxelRenderer(const RadianceField& field, Backend backend) {
  return std::make_unique<VoxelRenderer>(field, backend);
}

}  // namespace regrade
