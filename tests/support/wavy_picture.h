// Small pictures like photos.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/base/random.h"
#include "kernels/base/vec.h"
#include "kernels/scene/image.h"
#include "stylize/image/view_stylizer.h"
#include "tests/support/pictures.h"

namespace regrade::testing {

// Tints of two pictures.
inline const Vec3d kDay{0.8, 0.9, 1.0}, kEvening{1.0, 0.6, 0.35};

// Smooth waves, an edge and some grain.
inline Image WavyPicture(int width, int height, const Vec3d& tint) {
  Image image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 3; ++c) {
        const double wave = 0.25 * std::sin(x * 0.11 + c) + 0.2 * std::cos(y * 0.07 - c);
        const double edge = x + y > width ? 0.15 : -0.1;
        const double grain =
            0.04 * (RandomDouble(9, c, static_cast<uint64_t>(y) * width + x) - 0.5);
        image.at(x, y)[c] =
            static_cast<float>(std::clamp(tint[c] * (0.5 + wave + edge) + grain, 0.0, 1.0));
      }
  return image;
}

// Views of any size come back as they went.
template <typename Stylizer>
void ExpectAnySizeComesBack(const Stylizer& stylizer) {
  for (const auto& [width, height] :
       {std::pair{1, 1}, std::pair{8, 8}, std::pair{17, 90}, std::pair{131, 33}}) {
    const Image photo = WavyPicture(width, height, kDay);
    EXPECT_EQ(CheckStyledView(photo, stylizer.Stylize(photo, 0), "view 0"), 0);
  }
}

}  // namespace regrade::testing
