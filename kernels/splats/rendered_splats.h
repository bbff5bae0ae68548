// A picture of splats as a view of a field.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "kernels/field/render.h"
#include "kernels/splats/render_picture.h"

namespace regrade {

// Colours clipped; median depths, 0 where less than half of the light is from splats.
inline RenderedView RenderedSplats(SplatPicture<float> picture) {
  for (float& value : picture.color) value = std::clamp(value, 0.0f, 1.0f);
  const auto image = [&picture](int channels, std::vector<float>* values) {
    Image made;
    made.width = picture.width, made.height = picture.height, made.channels = channels;
    made.pixels = std::move(*values);
    return made;
  };
  return {.color = image(3, &picture.color),
          .depth = image(1, &picture.median_depth),
          .transmittance = image(1, &picture.transmittance)};
}

}  // namespace regrade
