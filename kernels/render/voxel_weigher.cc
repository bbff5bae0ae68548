#include "kernels/render/voxel_weigher.h"

#include "kernels/field/render_ray.h"
#include "kernels/field/resolve_pixel.h"

namespace regrade {
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
