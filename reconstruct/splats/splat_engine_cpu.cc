#include <algorithm>
#include <atomic>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/splats/cpu/render_splats.h"
#include "kernels/splats/rendered_splats.h"
#include "reconstruct/splats/splat_engine.h"

namespace regrade {
namespace {

class CpuSplatEngine : public SplatEngine {
 public:
  explicit CpuSplatEngine(const SplatOptions& options) : options_(options) {}

  void SetPhotos(const SplatPhotos* photos) override { photos_ = photos; }
  void SetState(SplatFitState state) override { state_ = std::move(state); }
  void ReadState(const std::function<void(SplatFitState*)>& read) override { read(&state_); }
  int64_t count() const override { return state_.splats.count(); }
  int basis() const override { return state_.splats.basis; }
  std::vector<float> OpacityLogits() override { return state_.splats.opacity_logit; }

  void Change(const PopulationChange& change) override {
    ApplyChange(change, false, &state_.splats);
    ApplyChange(change, true, &state_.first_moment);
    ApplyChange(change, true, &state_.second_moment);
  }

  void SetBasis(int basis) override {
    for (Splats* splats : {&state_.splats, &state_.first_moment, &state_.second_moment})
      PadBasis(basis, splats);
  }

  void Step(const SplatStep& step) override {
    const SplatPhoto& photo = (*photos_)[step.photo];
    SplatOptions options = options_;
    options.dropout = step.dropout;
    const int width = photo.camera.width, height = photo.camera.height;
    if (picture_.width != width || picture_.height != height)
      picture_ = d_picture_ = SplatPicture<float>(width, height);
    MakeSplatFrame(state_.splats.view(), photo.camera, options, &frame_);
    RenderSplats(frame_, &picture_);
    const PictureSums sums = Compare(
        width, height, photo.color.data(), photo.masked.empty() ? nullptr : photo.masked.data(),
        picture_.color.data(), step.ssim_weight, &rows_, d_picture_.color.data());
    if (step.depth_weight > 0) {
      std::ranges::fill(d_picture_.depth, 0.0f);
      std::ranges::fill(d_picture_.transmittance, 0.0f);
      for (const SeenDepth& seen : photo.depths)
        WriteDepthGradient(seen, std::ssize(photo.depths), step.depth_weight,
                           {picture_.depth.data(), picture_.transmittance.data()},
                           {d_picture_.depth.data(), d_picture_.transmittance.data()});
    }
    SumOverTiles(frame_, d_picture_, &tile_sums_);
    const SplatMoments to{PointersOf(&state_.splats), PointersOf(&state_.first_moment),
                          PointersOf(&state_.second_moment)};
    std::atomic<int64_t> rejected = 0;
    ForEachGradient(
        frame_, tile_sums_,
        [&](int64_t i, const Splat<float>& d, const float* d_sh) {
          const bool sound = UpdateShape(step.update, i, d, to) &
                             UpdateColors(step.update, i, frame_.splats.basis, d_sh, to);
          rejected += !sound;
        },
        step.update.frozen);
    sums_.picture.absolute += sums.absolute;
    sums_.picture.squared += sums.squared;
    sums_.picture.similarity += sums.similarity;
    sums_.picture.values += sums.values;
    sums_.entries += std::ssize(frame_.entry_splat);
    sums_.rejected += rejected;
  }

  SplatFitSums TakeSums() override { return std::exchange(sums_, {}); }

  RenderedView Render(const Camera& camera) override {
    return RenderedSplats(RenderSplats(MakeSplatFrame(state_.splats.view(), camera, options_)));
  }

 private:
  SplatOptions options_;
  const SplatPhotos* photos_ = nullptr;
  SplatFitState state_;
  SplatFitSums sums_;
  // Kept between steps.
  SplatFrame frame_;
  SplatPicture<float> picture_{0, 0}, d_picture_{0, 0};
  SplatTileSums tile_sums_;
  LossRows rows_;
};

}  // namespace

std::unique_ptr<SplatEngine> MakeCpuSplatEngine(const SplatOptions& options) {
  return std::make_unique<CpuSplatEngine>(options);
}

}  // namespace regrade
