// The plain picture of splats: every pixel against every splat in order, forward and adjoint.
//
// Splats are ordered by z in camera coordinates, rounded to float so that all paths have the
// same keys, and then by index. The results have the same bits for any number of threads.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/scene/camera.h"
#include "kernels/splats/seen_splat.h"
#include "kernels/splats/splat_camera.h"
#include "kernels/splats/splats.h"

namespace regrade {

// All splats that the camera may see, in order. The camera's lens must be kPinhole, without
// NDC; the options' near plane and blur must be above 0.
template <typename T>
std::vector<SeenSplat<T>> SeeSplats(const SplatsView<T>& splats, const Camera& camera,
                                    const SplatOptions& options);

// Raw sums, or a gradient by them: colours are neither clipped nor divided.
template <typename T>
struct SplatPicture {
  int width = 0, height = 0;
  std::vector<T> color;          // [H, W, 3] sRGB, with the background
  std::vector<T> depth;          // [H, W]: Z, see EQ(splat-composite); world units
  std::vector<T> median_depth;   // [H, W]: world units; 0: none. Not in a gradient
  std::vector<T> transmittance;  // [H, W]: T_N

  SplatPicture(int width, int height)
      : width(width),
        height(height),
        color(3 * static_cast<size_t>(width) * height),
        depth(static_cast<size_t>(width) * height),
        median_depth(depth.size()),
        transmittance(depth.size()) {}
};

template <typename T>
SplatPicture<T> RenderSplatsPlain(const SplatsView<T>& splats, const Camera& camera,
                                  const SplatOptions& options);

// The gradient by all values of the splats and the background for that by a picture's color,
// depth and transmittance. Sums over pixels are in double.
template <typename T>
SplatArrays<T> RenderSplatsPlainAdjoint(const SplatsView<T>& splats, const Camera& camera,
                                        const SplatOptions& options,
                                        const SplatPicture<T>& d_picture);

// What pixel (x, y) sees, front to back.
template <typename T>
struct SplatWeight {
  int32_t index;
  T weight;  // w_i of EQ(splat-composite)
};
template <typename T>
std::vector<SplatWeight<T>> WeightsOfPixel(const std::vector<SeenSplat<T>>& seen, int x, int y);

}  // namespace regrade
