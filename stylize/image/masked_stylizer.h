// A 2D method at work in regions of a picture: each region in its own part of the style, what
// is in none as it was.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stylize/image/view_stylizer.h"

namespace regrade {

// How much of each pixel belongs to each region: [regions] of [H, W, 1] in [0, 1] that sum to
// at most 1.
using CoverageFunction = std::function<std::vector<Image>(const Image& view, int view_index)>;

// EQ(region-mix): result = view + sum_k m_k (styled_k - view), m_k the coverage of region k:
// the weights of all parts sum to 1, and a pixel with m = 0 keeps its bits. styled_k is what
// `regions[k]` makes of the view, or with `alpha_tells` of a view whose alpha says which pixels
// are of the region: methods that measure colours measure those alone. A region that a view
// does not show is left out. `notices` are said beside those of the methods.
std::unique_ptr<ViewStylizer> MakeMaskedStylizer(
    std::vector<std::unique_ptr<ViewStylizer>> regions, bool alpha_tells,
    CoverageFunction coverage, std::vector<std::string> notices = {});

// `view` in three channels with an alpha of 1 where `coverage` [H, W, 1] is above 1/2, or 0.
Image WithRegion(const Image& view, const Image& coverage);
// Whether any pixel is above 1/2.
bool ShowsRegion(const Image& coverage);

}  // namespace regrade
