// A 2D method with several style pictures, each at work in the regions of the scene that look
// like it.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/run/run_settings.h"
#include "stylize/image/view_stylizer.h"

namespace regrade {

// A photo, or nothing where it has no part to be measured.
using PhotoFunction = std::function<std::optional<Image>(size_t view)>;
// The method with one style picture, at `path`, for a scene with those photos.
using MethodMaker = std::function<std::unique_ptr<ViewStylizer>(
    const std::string& path, const Image& style, const PhotoFunction& photo)>;

// See EQ(region-match); `of_colors` as of MakeMaskedStylizer. Throws Error(kInput) where the
// regions are not clear, or no region looks like a picture, and asks for masks.
std::unique_ptr<ViewStylizer> MakeMatchedStylizer(const StyleSource& style, size_t views,
                                                  const PhotoFunction& photo, bool of_colors,
                                                  const MethodMaker& make);

}  // namespace regrade
