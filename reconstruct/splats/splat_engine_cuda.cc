#include <algorithm>
#include <utility>

#include "kernels/image/cuda/device_picture_loss.h"
#include "kernels/splats/cuda/device_seen_depth.h"
#include "kernels/splats/cuda/device_splat_update.h"
#include "kernels/splats/rendered_splats.h"
#include "reconstruct/splats/splat_engine.h"

namespace regrade {
namespace {

struct DevicePhoto {
  DeviceBuffer<uint16_t> color;
  DeviceBuffer<uint8_t> masked;
  DeviceBuffer<SeenDepth> depths;
};

class CudaSplatEngine : public SplatEngine {
 public:
  explicit CudaSplatEngine(const SplatOptions& options)
      : options_(options), rejected_(1, "rejected gradients") {
    rejected_.Zero();
  }

  void SetPhotos(const SplatPhotos* photos) override {
    photos_ = photos;
    on_device_.clear();
    int64_t most = 0;
    for (int i = 0; i < photos->count(); ++i) {
      const SplatPhoto& photo = (*photos)[i];
      DevicePhoto& own = on_device_.emplace_back();
      own.color = DeviceBuffer<uint16_t>(std::ssize(photo.color), "photos");
      own.color.CopyIn(photo.color.data(), std::ssize(photo.color));
      most = std::max(most, own.color.size());
      if (!photo.depths.empty()) {
        own.depths = DeviceBuffer<SeenDepth>(std::ssize(photo.depths), "depths of photos");
        own.depths.CopyIn(photo.depths.data(), std::ssize(photo.depths));
      }
      if (photo.masked.empty()) continue;
      own.masked = DeviceBuffer<uint8_t>(std::ssize(photo.masked), "masks");
      own.masked.CopyIn(photo.masked.data(), std::ssize(photo.masked));
    }
    if (d_picture_.size() >= most) return;
    d_picture_ = DeviceBuffer<float>(most, "gradient of a photo");
    d_depth_ = DeviceBuffer<float>(most / 3, "gradient of depths");
    d_transmittance_ = DeviceBuffer<float>(most / 3, "gradient of depths");
  }

  void SetState(SplatFitState state) override {
    splats_.value.Upload(state.splats);
    splats_.first.Upload(state.first_moment);
    splats_.second.Upload(state.second_moment);
  }

  void ReadState(const std::function<void(SplatFitState*)>& read) override {
    SplatFitState state;
    state.splats = splats_.value.Download();
    state.first_moment = splats_.first.Download();
    state.second_moment = splats_.second.Download();
    read(&state);
  }

  int64_t count() const override { return splats_.value.count; }
  int basis() const override { return splats_.value.basis; }

  std::vector<float> OpacityLogits() override {
    std::vector<float> logits(static_cast<size_t>(count()));
    splats_.value.opacity_logit.CopyOut(logits.data(), count());
    return logits;
  }

  void Change(const PopulationChange& change) override {
    ApplyChangeOnDevice(change, &splats_);
  }

  void SetBasis(int basis) override {
    for (DeviceSplats* splats : {&splats_.value, &splats_.first, &splats_.second}) {
      Splats host = splats->Download();
      PadBasis(basis, &host);
      const int64_t capacity = splats->capacity();
      splats->Upload(host);
      splats->Reserve(capacity);
    }
  }

  void Step(const SplatStep& step) override {
    const Camera& camera = (*photos_)[step.photo].camera;
    const DevicePhoto& photo = on_device_[static_cast<size_t>(step.photo)];
    SplatOptions options = options_;
    options.dropout = step.dropout;
    const bool depths = step.depth_weight > 0 && photo.depths.size() > 0;
    renderer_.Render(splats_.value.view(), camera, options,
                     depths ? SplatPass::kAdjoint : SplatPass::kColorAdjoint);
    loss_.Compare(camera.width, camera.height, photo.color.data(), photo.masked.data(),
                  renderer_.pixels().color, step.ssim_weight, d_picture_.data());
    SplatPixels<const float> d{};
    d.color = d_picture_.data();
    if (depths) {
      d_depth_.Zero();
      d_transmittance_.Zero();
      WriteDepthGradientOnDevice(photo.depths.data(), photo.depths.size(), step.depth_weight,
                                 {renderer_.pixels().depth, renderer_.pixels().transmittance},
                                 {d_depth_.data(), d_transmittance_.data()});
      d.depth = d_depth_.data();
      d.transmittance = d_transmittance_.data();
    }
    UpdateSplats(step.update, renderer_.SumPixels(d), splats_, rejected_.data());
    entries_ += renderer_.num_entries();
  }

  SplatFitSums TakeSums() override {
    SplatFitSums sums;
    sums.picture = loss_.TakeSums();
    sums.entries = std::exchange(entries_, 0);
    uint32_t rejected = 0;
    rejected_.CopyOut(&rejected, 1);
    rejected_.Zero();
    sums.rejected = rejected;
    return sums;
  }

  RenderedView Render(const Camera& camera) override {
    renderer_.Render(splats_.value.view(), camera, options_);
    return RenderedSplats(renderer_.Download());
  }

 private:
  SplatOptions options_;
  const SplatPhotos* photos_ = nullptr;
  std::vector<DevicePhoto> on_device_;
  DeviceBuffer<float> d_picture_, d_depth_, d_transmittance_;
  DeviceSplatMoments splats_;
  DeviceSplatRenderer renderer_;
  DevicePictureLoss loss_;
  DeviceBuffer<uint32_t> rejected_;
  int64_t entries_ = 0;
};

}  // namespace

std::unique_ptr<SplatEngine> MakeCudaSplatEngine(const SplatOptions& options) {
  return std::make_unique<CudaSplatEngine>(options);
}

}  // namespace regrade
