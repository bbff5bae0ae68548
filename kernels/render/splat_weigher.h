// The weights with which places of pictures see splats.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "kernels/render/ray_weigher.h"
#include "kernels/splats/splat_camera.h"
#include "kernels/splats/splats.h"

namespace regrade {

class SplatWeigher : public RayWeigher {
 public:
  // See MakeRayWeigher.
  SplatWeigher(const Geometry& geometry, float near_clip, int64_t kept_bytes);

  RayWeights Weigh(const ViewRays& rays, int64_t begin, int64_t end) override;

 private:
  // Of each tile of a camera's picture, the splats that it may show, front to back.
  struct TileLists {
    Camera camera;
    SplatCamera numbers;
    std::vector<int64_t> first;  // [tiles + 1]
    std::vector<int32_t> splat;
    int64_t bytes() const;
  };
  // Rays through one tile, in their order.
  struct Group {
    std::shared_ptr<const TileLists> lists;
    int tile = 0;
    std::vector<int64_t> rays;
    // Front to back for each ray; `ray` counts within the group.
    std::vector<WeightedSample> samples;
    std::vector<Vec3f> directions;
    std::vector<int32_t> ray;
  };

  std::shared_ptr<const TileLists> ListsOf(const Camera& camera);
  void WeighGroup(const ViewRays& rays, int64_t begin, Group* group, RayWeights* result) const;

  SplatsView<float> splats_;  // without colours
  SplatOptions options_;
  int64_t left_bytes_;
  std::vector<std::shared_ptr<const TileLists>> kept_;
  std::shared_ptr<const TileLists> last_;
};

// See MakeRayWeigher and RayDepths.
std::unique_ptr<RayWeigher> MakeSplatWeigher(const Geometry& geometry, float near_clip,
                                             const MarchOptions& march, int64_t kept_bytes);
std::vector<double> SplatDepths(const RadianceField& field, const ViewRays& rays,
                                RayWeigher* weigher);

}  // namespace regrade
