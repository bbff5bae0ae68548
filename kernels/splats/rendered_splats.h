// A picture of splats as a view of a field.
#pragma once

#include <algorithm>

#include "kernels/field/render.h"
#include "kernels/splats/render_picture.h"

namespace regrade {

// Colours clipped; expected depths, 0 where less than half of the light is from splats.
inline RenderedView RenderedSplats(const SplatPicture<float>& picture) {
  RenderedView view{Image(picture.width, picture.height),
                    Image(picture.width, picture.height, 1),
                    Image(picture.width, picture.height, 1)};
  std::ranges::transform(picture.color, view.color.pixels.begin(),
                         [](float value) { return std::clamp(value, 0.0f, 1.0f); });
  view.transmittance.pixels = picture.transmittance;
  for (size_t i = 0; i < picture.depth.size(); ++i) {
    const float weight = 1 - picture.transmittance[i];
    view.depth.pixels[i] = weight < 0.5f ? 0.0f : picture.depth[i] / weight;
  }
  return view;
}

}  // namespace regrade
