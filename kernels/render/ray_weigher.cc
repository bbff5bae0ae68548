#include "kernels/render/ray_weigher.h"

#include "kernels/field/render_ray.h"
#include "kernels/field/resolve_pixel.h"
#include "kernels/render/splat_weigher.h"

namespace regrade {
namespace {

class VoxelWeigher : public RayWeigher {
 public:
  VoxelWeigher(const Geometry& geometry, float near_clip, const MarchOptions& march,
               float min_weight)
      : geometry_(geometry), near_clip_(near_clip), march_(march), min_weight_(min_weight) {}

  RayWeights Weigh(const ViewRays& rays, int64_t begin, int64_t end) override {
    return ComputeRayWeights(geometry_, {rays.rays.data() + begin, end - begin}, march_,
                             near_clip_, min_weight_);
  }

 private:
  const Geometry& geometry_;
  float near_clip_;
  MarchOptions march_;
  float min_weight_;
};

double VoxelDepth(const FieldView<float>& field, const Camera& camera, const Ray& ray,
                  const MarchOptions& march) {
  const RayResult<float> result = RenderRay(field, ray, march);
  Vec3f color = result.color;
  float depth = result.depth;
  ResolvePixel{camera}(ray, result.transmittance, &color, &depth);
  return depth;
}

// Z over 1 - T of EQ(splat-composite).
double SplatDepth(const SplatGeometry& splats, const Camera& camera, const RayWeights& weights,
                  int64_t ray) {
  const double seen = 1 - double{weights.transmittance[static_cast<size_t>(ray)]};
  if (!(seen >= 0.5)) return 0;
  double sum = 0;
  for (int64_t i = weights.first[static_cast<size_t>(ray)];
       i < weights.first[static_cast<size_t>(ray) + 1]; ++i) {
    const WeightedSample& sample = weights.samples[static_cast<size_t>(i)];
    const float* const mean = splats.mean.data() + 3 * int64_t{sample.vertex};
    sum += double{sample.weight} *
           (camera.camera_from_world * Vec3f{mean[0], mean[1], mean[2]}.Cast<double>()).z;
  }
  return sum / seen;
}

}  // namespace

std::unique_ptr<RayWeigher> MakeRayWeigher(const Geometry& geometry, float near_clip,
                                           const MarchOptions& march, float min_weight,
                                           int64_t kept_bytes) {
  if (geometry.splats.on())
    return std::make_unique<SplatWeigher>(geometry, near_clip, min_weight, kept_bytes);
  return std::make_unique<VoxelWeigher>(geometry, near_clip, march, min_weight);
}

std::vector<double> RayDepths(const RadianceField& field, const ViewRays& rays,
                              const MarchOptions& march, RayWeigher* weigher) {
  std::vector<double> depths(rays.rays.size());
  const auto camera_of = [&](int64_t r) -> const Camera& {
    return rays.cameras[static_cast<size_t>(rays.places[static_cast<size_t>(r)].camera)];
  };
  if (field.geometry->splats.on()) {
    const RayWeights weights = weigher->Weigh(rays);
    for (int64_t r = 0; r < rays.size(); ++r)
      depths[static_cast<size_t>(r)] =
          SplatDepth(field.geometry->splats, camera_of(r), weights, r);
    return depths;
  }
  const FieldView<float> view = ViewOf(field);
#pragma omp parallel for schedule(dynamic, 16)
  for (int64_t r = 0; r < rays.size(); ++r)
    depths[static_cast<size_t>(r)] =
        VoxelDepth(view, camera_of(r), rays.rays[static_cast<size_t>(r)], march);
  return depths;
}

}  // namespace regrade
