// Bilinear sampling of an image at real positions, used by every warp in the project.
//
// Positions are pixel indices: (0, 0) is the centre of the first pixel, so an image point (u,
// v) in the camera convention (centres at +0.5) is the position (u - 0.5, v - 0.5).
#pragma once

#include <cmath>

#include "kernels/base/host_device.h"
#include "kernels/scene/image.h"

namespace regrade {

// The four pixels around a position with their weights. Outside the image the border is
// repeated.
struct BilinearTaps {
  int x0 = 0, x1 = 0, y0 = 0, y1 = 0;  // always valid indices
  double ax = 0, ay = 0;               // weight of x1 and of y1
  // The position lies within the outermost pixel centres: no border is repeated.
  bool in_frame = false;
  // All four taps are distinct pixels, including those of weight 0: floor(x) + 1 is in the
  // frame.
  bool four_taps = false;
};

// Any position is allowed; a non-finite one has in_frame = four_taps = false. The image needs
// at least one pixel.
HD inline BilinearTaps TapsAt(double x, double y, int width, int height) {
  using std::floor;
  BilinearTaps taps;
  taps.in_frame = x >= 0 && x <= width - 1 && y >= 0 && y <= height - 1;
  // Clamped before the cast: converting a huge or non-finite float to int is undefined
  // behaviour.
  const double cx = x >= 0 ? (x <= width - 1 ? x : width - 1) : 0;
  const double cy = y >= 0 ? (y <= height - 1 ? y : height - 1) : 0;
  taps.x0 = static_cast<int>(floor(cx));
  taps.y0 = static_cast<int>(floor(cy));
  taps.ax = cx - taps.x0;
  taps.ay = cy - taps.y0;
  taps.four_taps = taps.in_frame && taps.x0 + 1 < width && taps.y0 + 1 < height;
  taps.x1 = taps.x0 + 1 < width ? taps.x0 + 1 : taps.x0;
  taps.y1 = taps.y0 + 1 < height ? taps.y0 + 1 : taps.y0;
  return taps;
}

// Value of one channel of interleaved rows [height, width, channels]. A tap of weight 0 has no
// influence, whatever its value.
inline double Sample(const BilinearTaps& taps, const float* pixels, int width, int channels,
                     int channel) {
  const auto value = [&](int x, int y) -> double {
    return pixels[(static_cast<size_t>(y) * width + x) * channels + channel];
  };
  const auto blend = [](double a, double b, double t) { return t == 0 ? a : a + t * (b - a); };
  const double top = blend(value(taps.x0, taps.y0), value(taps.x1, taps.y0), taps.ax);
  if (taps.ay == 0) return top;
  return blend(top, blend(value(taps.x0, taps.y1), value(taps.x1, taps.y1), taps.ax), taps.ay);
}

inline double Sample(const BilinearTaps& taps, const Image& image, int channel) {
  return Sample(taps, image.pixels.data(), image.width, image.channels, channel);
}

}  // namespace regrade
