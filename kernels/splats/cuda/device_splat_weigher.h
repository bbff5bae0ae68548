// What rays of pictures see of splats, on a CUDA device; see SplatWeigher, whose weights these
// are.
#pragma once

#include <vector>

#include "kernels/scene/view_rays.h"
#include "kernels/splats/cuda/device_splats.h"
#include "kernels/splats/cuda/tile_lists.h"
#include "kernels/splats/cuda/weigh_places.h"

namespace regrade {

// Of groups of rays, in the layouts of SplatSamplesView; used again, it grows as needed.
struct DeviceSplatSamples {
  DeviceBuffer<SplatSample> sample;
  DeviceBuffer<float> transmittance;
  DeviceBuffer<int32_t> count;
  int64_t groups = 0, rays = 0, capacity = 0;
  int64_t most = 0;  // samples of a group

  SplatSamplesView view() const {
    return {sample.data(), capacity, count.data(), transmittance.data()};
  }
};

// Which splats the tiles of a camera's picture show is kept while memory lasts, 4 bytes for
// each tile that a splat is in, and otherwise made for each call. A place between the centres
// of pixels sees the splats of its tile's pixels.
class DeviceSplatWeigher {
 public:
  // Uploads `splats`, without their colours.
  DeviceSplatWeigher(const SplatsView<float>& splats, const SplatOptions& options,
                     int64_t kept_bytes);

  // Rays [begin, end) of a batch; their cameras are pinholes.
  struct Group {
    const ViewRays* rays;
    int64_t begin, end;
  };
  // Each group is filled up to `rays` with rays that see nothing. Samples that weigh at most
  // min_weight are dropped. Waits for the device.
  void Weigh(const std::vector<Group>& groups, int64_t rays, float min_weight,
             DeviceSplatSamples* samples);

  const DeviceSplats& splats() const { return splats_; }

 private:
  // Ranges of tiles and splats in one array, see CameraLists; empty where they are not kept.
  struct View {
    Camera camera;
    DeviceBuffer<int32_t> lists;
  };

  // Indices of cameras become those of views_.
  std::vector<ViewPlace> PlacesOf(const std::vector<Group>& groups, int64_t rays);
  int32_t ViewOf(const Camera& camera, int32_t first_guess);
  // Makes tiles_; returns the length of View::lists.
  int64_t MakeTiles(const Camera& camera);
  CameraLists StoreTiles(const Camera& camera, const DeviceBuffer<int32_t>& lists) const;
  void WeighViews(const std::vector<bool>& used, const PlaceGroups& places, float min_weight,
                  const SplatSamplesView& samples);

  DeviceSplats splats_;
  SplatOptions options_;
  int64_t left_bytes_;
  std::vector<View> views_;          // of all cameras so far
  std::vector<CameraLists> lists_;   // [views]; of those that are kept
  DeviceBuffer<CameraLists> table_;  // [views]
  DeviceBuffer<ViewPlace> places_;
  DeviceBuffer<SplatRecord> record_;
  DeviceBuffer<int32_t> num_tiles_, index_, passing_;
  DeviceBuffer<uint32_t> z_bits_;
  TileLists tiles_;
};

}  // namespace regrade
