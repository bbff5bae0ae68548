#include "kernels/base/random.h"
#include "kernels/device/launch_size.h"
#include "kernels/field/cuda/device_views.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

__device__ Ray RayThrough(const DeviceViews::View& view, const Vec3f* directions, int x,
                          int y) {
  Ray ray{view.origin,
          view.world_from_camera *
              directions[view.direction_map + static_cast<int64_t>(y) * view.width + x]};
  if (view.ndc.on()) NdcRay(view.ndc, &ray.origin, &ray.direction);
  return ray;
}

__global__ void DrawKernel(const DeviceViews::View* views, int num_views,
                           const Vec3f* directions, const uint16_t* colors,
                           const int32_t* drawn, uint64_t seed, uint64_t step, int64_t n,
                           Ray* rays, Vec3f* targets) {
  const int64_t i = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (i >= n) return;
  // Stratified over the views with a random offset, so that a batch covers all views evenly.
  const double turn = RandomDouble(seed, step, 0);
  const double position = (static_cast<double>(i) + turn) / static_cast<double>(n) * num_views;
  const DeviceViews::View view = views[static_cast<int>(position) % num_views];
  const uint64_t counter = 1 + 2 * static_cast<uint64_t>(i);
  int x, y;
  if (view.num_drawn == 0) {
    x = static_cast<int>(RandomIndex(seed, step, counter, static_cast<uint64_t>(view.width)));
    y = static_cast<int>(
        RandomIndex(seed, step, counter + 1, static_cast<uint64_t>(view.height)));
  } else {
    const int32_t pixel =
        drawn[view.drawn + static_cast<int64_t>(RandomIndex(
                               seed, step, counter, static_cast<uint64_t>(view.num_drawn)))];
    x = pixel % view.width;
    y = pixel / view.width;
  }
  rays[i] = RayThrough(view, directions, x, y);
  const uint16_t* color = colors + view.color + (static_cast<int64_t>(y) * view.width + x) * 3;
  targets[i] = {color[0] / 65535.0f, color[1] / 65535.0f, color[2] / 65535.0f};
}

__global__ void RaysKernel(DeviceViews::View view, const Vec3f* directions, int stride,
                           int columns, int64_t n, Ray* rays) {
  const int64_t i = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (i >= n) return;
  rays[i] = RayThrough(view, directions, static_cast<int>(i % columns) * stride,
                       static_cast<int>(i / columns) * stride);
}

}  // namespace

DeviceViews::DeviceViews(const std::vector<std::vector<Vec3f>>& direction_maps,
                         const std::vector<DeviceViewSource>& views) {
  std::vector<int64_t> map_begin;
  int64_t directions = 0, colors = 0, drawn = 0;
  for (const auto& map : direction_maps) {
    map_begin.push_back(directions);
    directions += static_cast<int64_t>(map.size());
  }
  for (const DeviceViewSource& source : views) {
    host_views_.push_back({source.origin, source.world_from_camera, source.ndc, source.width,
                           source.height,
                           map_begin.at(static_cast<size_t>(source.direction_map)), colors,
                           drawn, source.num_drawn});
    drawn += source.num_drawn;
    if (source.color != nullptr) colors += int64_t{source.width} * source.height * 3;
  }
  directions_ = DeviceBuffer<Vec3f>(directions, "directions of rays");
  for (size_t m = 0; m < direction_maps.size(); ++m)
    DeviceCopyIn(directions_.data() + map_begin[m], direction_maps[m].data(),
                 static_cast<int64_t>(direction_maps[m].size() * sizeof(Vec3f)));
  colors_ = DeviceBuffer<uint16_t>(colors, "photos");
  for (size_t v = 0; v < views.size(); ++v)
    if (views[v].color != nullptr)
      DeviceCopyIn(colors_.data() + host_views_[v].color, views[v].color,
                   int64_t{views[v].width} * views[v].height * 6);
  drawn_ = DeviceBuffer<int32_t>(drawn, "pixels to draw");
  for (size_t v = 0; v < views.size(); ++v)
    if (views[v].num_drawn > 0)
      DeviceCopyIn(drawn_.data() + host_views_[v].drawn, views[v].drawn,
                   int64_t{views[v].num_drawn} * int64_t{sizeof(int32_t)});
  views_ = DeviceBuffer<View>(num_views(), "cameras");
  views_.CopyIn(host_views_.data(), num_views());
}

void DeviceViews::Draw(uint64_t seed, uint64_t step, int64_t n, Ray* rays,
                       Vec3f* targets) const {
  DrawKernel<<<BlocksFor(n), kThreads>>>(views_.data(), num_views(), directions_.data(),
                                         colors_.data(), drawn_.data(), seed, step, n, rays,
                                         targets);
  CheckLaunch("draw_rays");
}

int64_t DeviceViews::RaysOf(int view, int stride, Ray* rays) const {
  const View& v = host_views_[static_cast<size_t>(view)];
  const int columns = (v.width + stride - 1) / stride;
  const int64_t n = int64_t{columns} * ((v.height + stride - 1) / stride);
  if (rays == nullptr) return n;
  RaysKernel<<<BlocksFor(n), kThreads>>>(v, directions_.data(), stride, columns, n, rays);
  CheckLaunch("rays_of_view");
  return n;
}

#else

DeviceViews::DeviceViews(const std::vector<std::vector<Vec3f>>&,
                         const std::vector<DeviceViewSource>&) {
  DeviceWait("draw_rays");
}
void DeviceViews::Draw(uint64_t, uint64_t, int64_t, Ray*, Vec3f*) const {}
int64_t DeviceViews::RaysOf(int, int, Ray*) const { return 0; }

#endif

}  // namespace regrade
