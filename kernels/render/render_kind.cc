#include "kernels/render/render_kind.h"

#include "kernels/render/optical_depth.h"
#include "kernels/render/splat_renderer.h"
#include "kernels/render/splat_weigher.h"
#include "kernels/render/voxel_renderer.h"

namespace regrade {

const RenderKind& RenderKindOf(const Geometry& geometry) {
  static constexpr RenderKind kOfVoxels{MakeVoxelRenderer, TakeVoxels, MakeVoxelWeigher,
                                        VoxelDepths, VoxelDepthAlong};
  static constexpr RenderKind kOfSplats{MakeSplatRenderer, TakeSplats, MakeSplatWeigher,
                                        SplatDepths, SplatDepthAlong};
  return geometry.splats.on() ? kOfSplats : kOfVoxels;
}

}  // namespace regrade
