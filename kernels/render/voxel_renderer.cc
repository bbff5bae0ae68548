#include "kernels/render/voxel_renderer.h"

#include <utility>

#include "kernels/base/error.h"
#include "kernels/field/cuda/device_grid.h"
#include "kernels/field/cuda/device_rays.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/render_ray.h"
#include "kernels/field/resolve_pixel.h"

namespace regrade {
namespace {

class VoxelRenderer : public Renderer {
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

  RenderedPair RenderWith(const Renderer& other, const Camera& camera) const override {
    if (backend_ == Backend::kCpu)
      return RenderViewPair(grid_, Same(other).grid_, camera, march_);
    return {Render(camera), other.Render(camera).color};
  }

 private:
  const VoxelRenderer& Same(const Renderer& other) const {
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

std::unique_ptr<Renderer> MakeVoxelRenderer(const RadianceField& field, Backend backend) {
  return std::make_unique<VoxelRenderer>(field, backend);
}

std::unique_ptr<Renderer> TakeVoxels(RadianceField&& field, Backend backend) {
  const RadianceField taken = std::move(field);
  return MakeVoxelRenderer(taken, backend);
}

namespace {

class VoxelWeigher : public RayWeigher {
 public:
  VoxelWeigher(const Geometry& geometry, float near_clip, const MarchOptions& march)
      : geometry_(geometry), near_clip_(near_clip), march_(march) {}

  RayWeights Weigh(const ViewRays& rays, int64_t begin, int64_t end) override {
    return ComputeRayWeights(geometry_, {rays.rays.data() + begin, end - begin}, march_,
                             near_clip_, min_weight);
  }

 private:
  const Geometry& geometry_;
  float near_clip_;
  MarchOptions march_;
};

double VoxelDepth(const FieldView<float>& field, const Camera& camera, const Ray& ray,
                  const MarchOptions& march) {
  const RayResult<float> result = RenderRay(field, ray, march);
  Vec3f color = result.color;
  float depth = result.depth;
  ResolvePixel{camera}(ray, result.transmittance, &color, &depth);
  return depth;
}

}  // namespace

std::unique_ptr<RayWeigher> MakeVoxelWeigher(const Geometry& geometry, float near_clip,
                                             const MarchOptions& march, int64_t) {
  return std::make_unique<VoxelWeigher>(geometry, near_clip, march);
}

std::vector<double> VoxelDepths(const RadianceField& field, const ViewRays& rays, RayWeigher*) {
  std::vector<double> depths(rays.rays.size());
  const FieldView<float> view = ViewOf(field);
#pragma omp parallel for schedule(dynamic, 16)
  for (int64_t r = 0; r < rays.size(); ++r)
    depths[static_cast<size_t>(r)] =
        VoxelDepth(view, rays.CameraOf(r), rays.rays[static_cast<size_t>(r)], field.march);
  return depths;
}

}  // namespace regrade
