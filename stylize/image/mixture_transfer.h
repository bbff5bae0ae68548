// 2D method gmm: optimal transport between mixtures of Gaussians in colour.
#pragma once

#include <memory>
#include <vector>

#include "kernels/base/vec.h"
#include "stylize/image/style_options.h"
#include "stylize/image/view_stylizer.h"

namespace regrade {

// `scene`, colours of all views, gives the mixture that the views share: each view's mixture
// starts from it, so that the parts of neighbouring views correspond, or is it where
// options.scene_wide. `heights` are those of the colours in their views, from 0 at the bottom
// to 1 at the top; only a positive options.height_weight needs them. See EQ(mixture-transport).
std::unique_ptr<ViewStylizer> MakeMixtureTransfer(const StyleOptions& options,
                                                  const Image& style,
                                                  const std::vector<Vec3d>& scene,
                                                  const std::vector<double>& heights = {});

}  // namespace regrade
