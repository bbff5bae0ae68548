#include "kernels/splats/cuda/device_splat_renderer.h"

#include "kernels/base/error.h"
#include "kernels/splats/cuda/dense_adjoint.h"
#include "kernels/splats/cuda/grow_buffer.h"
#include "kernels/splats/cuda/see_splats.h"
#include "kernels/splats/cuda/slot_sums.h"
#include "kernels/splats/cuda/tile_adjoint.h"

namespace regrade {

void DeviceSplatRenderer::Grow(int64_t count, const TileGrid& grid, SplatPass pass) {
  GrowBuffer(count, "splats of a picture", &record_);
  GrowBuffer(count, "tiles of splats", &num_tiles_);
  GrowBuffer(count, "order of splats", &index_);
  GrowBuffer(count, "order of splats", &z_bits_);
  const int64_t pixels = int64_t{grid.width} * grid.height;
  GrowBuffer(3 * pixels, "a picture", &color_);
  GrowBuffer(pixels, "a picture", &transmittance_);
  const bool depth = pass != SplatPass::kColorAdjoint;
  if (depth) {
    GrowBuffer(pixels, "depths", &depth_);
    GrowBuffer(pixels, "depths", &median_depth_);
  }
  pixels_ = {color_.data(), depth ? depth_.data() : nullptr,
             depth ? median_depth_.data() : nullptr, transmittance_.data()};
}

KeptTiles DeviceSplatRenderer::Kept() const {
  if (pass_ == SplatPass::kPicture) return {};
  return {checkpoint_.data(), pass_ == SplatPass::kAdjoint ? checkpoint_depth_.data() : nullptr,
          bucket_.data(), num_buckets_.data()};
}

void DeviceSplatRenderer::Render(const SplatsView<float>& splats, const Camera& camera,
                                 const SplatOptions& options, SplatPass pass) {
  REGRADE_CHECK(camera.lens == LensModel::kPinhole && !camera.ndc.on());
  REGRADE_CHECK(options.near_plane > 0 && options.blur > 0);
  const DeviceRange range("render splats");
  const TileGrid grid(camera.width, camera.height);
  pass_ = pass;
  Grow(splats.count, grid, pass);
  view_ = {};
  view_.splats = splats;
  view_.camera = SplatCamera(camera);
  view_.options = options;
  grid_ = grid;
  const SeenSplats seen{record_.data(), num_tiles_.data(), z_bits_.data(), index_.data()};
  SeeSplatsOnDevice(splats, view_.camera, options, grid, seen);
  lists_.Make(seen, splats.count, grid);
  if (pass != SplatPass::kPicture) {
    const int64_t checkpoints = NumCheckpoints(num_entries(), grid.count());
    GrowBuffer(checkpoints * kTilePixels, "pixels between splats", &checkpoint_);
    if (pass == SplatPass::kAdjoint)
      GrowBuffer(checkpoints * kTilePixels, "pixels between splats", &checkpoint_depth_);
    GrowBuffer(checkpoints + kBucketRoom, "buckets of splats", &bucket_);
    GrowBuffer(1, "number of buckets", &num_buckets_);
    num_buckets_.Zero();
  }
  CompositeTiles(lists_.view(), record_.data(), splats.background, pixels_, Kept());
}

SplatPicture<float> DeviceSplatRenderer::Download() const {
  SplatPicture<float> picture(grid_.width, grid_.height);
  const int64_t pixels = static_cast<int64_t>(picture.depth.size());
  color_.CopyOut(picture.color.data(), 3 * pixels);
  transmittance_.CopyOut(picture.transmittance.data(), pixels);
  if (pixels_.depth == nullptr) return picture;
  depth_.CopyOut(picture.depth.data(), pixels);
  median_depth_.CopyOut(picture.median_depth.data(), pixels);
  return picture;
}

const SplatSumsView& DeviceSplatRenderer::SumPixels(const SplatPixels<const float>& d) {
  REGRADE_CHECK(pass_ == SplatPass::kAdjoint ||
                (pass_ == SplatPass::kColorAdjoint && d.depth == nullptr));
  const DeviceRange range("adjoint of splats");
  const int64_t tiles = grid_.count();
  const bool depth = d.depth != nullptr;
  GrowBuffer(tiles * kTilePixels, "gradients of pixels", &pixel_gradient_);
  if (depth) GrowBuffer(tiles * kTilePixels, "gradients of pixels", &pixel_gradient_depth_);
  GrowBuffer(2 * tiles + 1, "gradients of a background", &background_);
  GrowBuffer(view_.splats.count, "gradients of colours", &color_sums_);
  // New slots have no stamp; after 2^32 pictures none may have an old one.
  if (num_entries() > sums_.size() || ++stamp_ == 0) {
    GrowBuffer(num_entries(), "gradients of splats in tiles", &sums_);
    sums_.Zero();
    stamp_ = 1;
  }
  const TileGradients gradients{pixel_gradient_.data(),
                                depth ? pixel_gradient_depth_.data() : nullptr,
                                background_.data(), background_.data() + 2 * tiles};
  GatherPixelGradients(grid_, pixels_, d, gradients);
  if (num_entries() > 0) {
    AddTileAdjoints(lists_.view(), record_.data(), Kept(),
                    NumCheckpoints(num_entries(), grid_.count()), gradients, stamp_,
                    sums_.data());
    SumSlots(lists_.order(), num_tiles_.data(), lists_.first_slot(), view_.splats.count, stamp_,
             sums_.data());
  }
  view_.record = record_.data();
  view_.num_tiles = num_tiles_.data();
  view_.first_slot = lists_.first_slot();
  view_.sums = sums_.data();
  view_.color = color_sums_.data();
  view_.d_background = gradients.d_background;
  return view_;
}

void DeviceSplatRenderer::Adjoint(const SplatPixels<const float>& d, DeviceSplats* gradient) {
  StoreSplatGradients(SumPixels(d), gradient);
}

}  // namespace regrade
