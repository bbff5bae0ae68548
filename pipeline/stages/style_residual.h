// The residual by voxel of a style: what its network lacks to the 2D method's pictures of
// renders, and to what single photos have beyond them.
#pragma once

#include <vector>

#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/network_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/run/run_context.h"
#include "stylize/field/voxel_residual.h"

namespace regrade {

// As --residual asks for it. Cameras of `views` are in the field's frame. Targets are
// made of renders, not of photos: the field's own errors are not the style's.
//   views   what the 2D method makes of the unstyled renders of `indices`
//   layers  that, and then, of the photos that have a layer, method(render) with the edit (see
//           RenderedEdit), fitted to what is left, in turns with the scale, see EQ(view-scale),
//           and with what the renderer shows of the turn before; the cost of this part is
//           higher, for it is seen from a few places
VoxelResidual FitStyleResidual(RunContext* context, const WorkingViews& views,
                               const StoredField& source, const StoredNetwork& network,
                               const std::vector<int>& indices,
                               const ProgressFunction& progress);

// A layer as a 16-bit picture: (1 + v) / 2.
void WriteLayer(const std::string& path, const Image& layer);

// What the stage depends on besides: the option and the hashes of the layers.
JsonValue ResidualInputs(const ResidualChoice& choice);

}  // namespace regrade
