// Pictures of splats and their gradients on a CUDA device, see RenderSplatsPlain and
// RenderSplatsPlainAdjoint.
#pragma once

#include "kernels/scene/camera.h"
#include "kernels/splats/cuda/composite_tiles.h"
#include "kernels/splats/cuda/device_splats.h"
#include "kernels/splats/cuda/pixel_gradients.h"
#include "kernels/splats/cuda/splat_adjoint.h"
#include "kernels/splats/cuda/tile_lists.h"
#include "kernels/splats/render_picture.h"

namespace regrade {

// What is rendered and kept: less is faster.
enum class SplatPass {
  kPicture,       // colour, transmittance and depths; no adjoint can follow
  kColorAdjoint,  // colour and transmittance, and what the adjoint of both needs
  kAdjoint,       // all, and what the adjoint of all needs
};

// Its memory is kept between calls, and grows by halves. In bytes:
//   for each splat 80, with an adjoint 24 more;
//   for each entry (a splat in a tile of 8 x 8 pixels) 20, or 24 above 65536 tiles;
//   with an adjoint 80.5 more for each entry, for kAdjoint 88.5;
//   for each pixel 24, with an adjoint 32 or 40 more.
//
// Every call enqueues its work behind earlier work on the device. Render waits once, for the
// number of entries. All results have the same bits for equal input.
class DeviceSplatRenderer {
 public:
  // `splats`: of device memory whose arrays are aligned to 16 bytes, as those of DeviceSplats
  // are; it must not change before the adjoint. Requires what SeeSplats does of the camera and
  // the options. Throws Error(kResources).
  void Render(const SplatsView<float>& splats, const Camera& camera,
              const SplatOptions& options, SplatPass pass = SplatPass::kPicture);

  // The picture that Render left on the device; without depths for kColorAdjoint.
  SplatPixels<float> pixels() const { return pixels_; }
  SplatPicture<float> Download() const;
  int64_t num_entries() const { return lists_.num_entries(); }

  // Sums the adjoint over the pixels, for the gradient by a picture in device memory; a null
  // array of `d` counts as zeros, d.median_depth is not used, and d.depth needs kAdjoint. The
  // result is for UseSplatGradients, and valid until the next call.
  const SplatSumsView& SumPixels(const SplatPixels<const float>& d);

  // SumPixels, with all gradients stored.
  void Adjoint(const SplatPixels<const float>& d, DeviceSplats* gradient);

 private:
  void Grow(int64_t count, const TileGrid& grid, SplatPass pass);
  KeptTiles Kept() const;

  SplatPass pass_ = SplatPass::kPicture;
  TileGrid grid_;
  SplatPixels<float> pixels_;
  SplatSumsView view_;
  TileLists lists_;

  DeviceBuffer<SplatRecord> record_;
  DeviceBuffer<int32_t> num_tiles_, index_;
  DeviceBuffer<uint32_t> z_bits_;
  DeviceBuffer<float> color_, depth_, median_depth_, transmittance_;

  DeviceBuffer<PixelCheckpoint> checkpoint_;
  DeviceBuffer<float> checkpoint_depth_;
  DeviceBuffer<TileBucket> bucket_;
  DeviceBuffer<int32_t> num_buckets_;
  DeviceBuffer<PixelGradient> pixel_gradient_;
  DeviceBuffer<float> pixel_gradient_depth_;
  DeviceBuffer<Vec3f> background_;
  DeviceBuffer<SlotSums> sums_;
  DeviceBuffer<ColorSums> color_sums_;
  uint32_t stamp_ = 0;  // of the last adjoint's slots
};

}  // namespace regrade
