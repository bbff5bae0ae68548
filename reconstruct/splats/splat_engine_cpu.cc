#include <algorithm>
#include <atomic>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/splats/cpu/render_splats.h"
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
    const int width = photo.camera.width, height = photo.camera.height;
    if (picture_.width != width || picture_.height != height)
      picture_ = d_picture_ = SplatPicture<float>(width, height);
    MakeSplatFrame(state_.splats.view(), photo.camera, options_, &frame_);
    RenderSplats(frame_, &picture_);
    const PictureSums sums = Compare(
        width, height, photo.color.data(), photo.masked.empty() ? nullptr : photo.masked.data(),
        picture_.color.data(), step.ssim_weight, &rows_, d_picture_.color.data());
    SumOverTiles(frame_, d_picture_, &tile_sums_);
    const SplatMoments to{PointersOf(&state_.splats), PointersOf(&state_.first_moment),
                          PointersOf(&state_.second_moment)};
    std::atomic<int64_t> rejected = 0;
    ForEachGradient(frame_, tile_sums_, [&](int64_t i, const Splat<float>& d, const float* d_sh) {
      if (!UpdateSplat(step.update, i, frame_.splats.basis, d, d_sh, to)) ++rejected;
    });
    sums_.picture.absolute += sums.absolute;
    sums_.picture.squared += sums.squared;
    sums_.picture.similarity += sums.similarity;
    sums_.picture.values += sums.values;
    sums_.pairs += std::ssize(frame_.entry_splat);
    sums_.rejected += rejected;
  }

  SplatFitSums TakeSums() override { return std::exchange(sums_, {}); }

  RenderedView Render(const Camera& camera) override {
    const SplatPicture<float> picture =
        RenderSplats(MakeSplatFrame(state_.splats.view(), camera, options_));
    RenderedView view{Image(camera.width, camera.height),
                      Image(camera.width, camera.height, 1),
                      Image(camera.width, camera.height, 1)};
    for (size_t i = 0; i < picture.color.size(); ++i)
      view.color.pixels[i] = std::clamp(picture.color[i], 0.0f, 1.0f);
    view.transmittance.pixels = picture.transmittance;
    for (size_t i = 0; i < picture.depth.size(); ++i) {
      const float weight = 1 - picture.transmittance[i];
      view.depth.pixels[i] = weight < 0.5f ? 0.0f : picture.depth[i] / weight;
    }
    return view;
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

void ApplyChange(const PopulationChange& change, bool moments, Splats* splats) {
  const int64_t sh = 3 * splats->basis;
  const auto resize = [&](std::vector<float>* values, int64_t each) {
    values->resize(static_cast<size_t>(each * change.count));
  };
  resize(&splats->mean, 3);
  resize(&splats->log_scale, 3);
  resize(&splats->quaternion, 4);
  resize(&splats->opacity_logit, 1);
  resize(&splats->sh, sh);
  const auto each = [&](const auto& edit) {
    edit(&splats->mean, 3), edit(&splats->log_scale, 3), edit(&splats->quaternion, 4);
    edit(&splats->opacity_logit, 1), edit(&splats->sh, sh);
  };
  for (const CopiedSplat& copied : change.copied) {
    const size_t i = static_cast<size_t>(copied.index);
    if (moments) {
      each([&](std::vector<float>* values, int64_t n) {
        std::fill_n(values->begin() + n * copied.index, n, 0.0f);
      });
      continue;
    }
    splats->opacity_logit[i] = copied.opacity_logit;
    for (size_t a = 0; a < 3; ++a) splats->log_scale[3 * i + a] += copied.log_factor;
  }
  for (const SplatCopy& copy : change.copies)
    each([&](std::vector<float>* values, int64_t n) {
      std::copy_n(values->begin() + n * copy.from, n, values->begin() + n * copy.to);
    });
}

void PadBasis(int basis, Splats* splats) {
  REGRADE_CHECK(basis >= splats->basis);
  std::vector<float> sh(static_cast<size_t>(3 * basis * splats->count()));
  for (int64_t row = 0; row < 3 * splats->count(); ++row)
    std::copy_n(splats->sh.begin() + row * splats->basis, splats->basis,
                sh.begin() + row * basis);
  splats->sh = std::move(sh);
  splats->basis = basis;
}

}  // namespace regrade
