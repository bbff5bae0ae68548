// A 2D method that is one map of colours, known beforehand: a LUT.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "kernels/base/vec.h"
#include "stylize/image/view_stylizer.h"

namespace regrade {

// `map` takes colours in [0, 1] and is called by several threads. The views are mapped pixel by
// pixel: equal colours stay equal in all of them.
std::unique_ptr<ViewStylizer> MakeMapStylizer(std::function<Vec3d(const Vec3d&)> map,
                                              std::string name,
                                              std::vector<std::string> notices);

// Three channels of each pixel by `map`; see Colors and WithColors.
Image MapView(const Image& view, const std::function<Vec3d(const Vec3d&)>& map);

}  // namespace regrade
