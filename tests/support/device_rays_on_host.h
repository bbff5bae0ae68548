// Runs on the host what threads of a device do for rays through an adaptive field.
#pragma once

#include <vector>

#include "kernels/field/cuda/cell_ray.h"
#include "kernels/field/packed_grid.h"

namespace regrade::testing {

// The device's view of a grid on the host.
inline DeviceGridView HostView(FastGrid* grid) {
  DeviceGridView view;
  view.frame = grid->frame;
  view.dense_density = grid->vertex_density.data();
  view.records = grid->records.data();
  view.stride = grid->lanes();
  view.num_voxels = static_cast<int32_t>(grid->num_voxels());
  view.background = grid->background;
  view.near_clip = grid->near_clip;
  view.cells = ViewOf(grid->cells(), grid->frame.resolution);
  view.vertex_key = grid->cells().vertex_key.data();
  return view;
}

template <int kBasis>
std::vector<FourFloats> ColorsOf(const DeviceGridView& view, const PinholeRays& rays) {
  std::vector<FourFloats> colors;
  for (int32_t v = 0; v < view.num_voxels; ++v)
    colors.push_back(ColorOfVertex<kBasis>(view, rays, v));
  return colors;
}

}  // namespace regrade::testing
