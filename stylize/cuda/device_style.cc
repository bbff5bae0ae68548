#include "stylize/cuda/device_style.h"

#include <algorithm>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/network/cuda/device_mlp.h"
#include "stylize/cuda/device_batches.h"
#include "stylize/cuda/device_color_loss.h"
#include "stylize/cuda/device_ray_weights.h"
#include "stylize/field/base_map.h"

namespace regrade {
namespace {

constexpr int64_t kBandRays = 1 << 16;

void AddBaseMap(const LipschitzNetworkData& data, const float* features, int64_t n,
                float* rows) {
  if (!data.has_base) return;
  const RowMap map = RowMapOf(data.base);
  AddMappedRows({data.basis}, map.matrix, map.constant, features, n, rows);
}

// Grown, never shrunk: what one step needed the next one needs about as much of. An eighth more
// than asked for: whole views of a large field take gigabytes.
template <typename T>
void Reserve(int64_t size, const char* what, DeviceBuffer<T>* buffer) {
  if (buffer->size() >= size) return;
  *buffer = {};
  *buffer = DeviceBuffer<T>(size + size / 8, what);
}

class DeviceStyleLoss : public StyleLoss {
 public:
  DeviceStyleLoss(const DeviceStyleField* field, const AggregationOptions& options)
      : field_(*field),
        options_(options),
        stride_(field->row().stride()),
        touched_(field->grid),
        slots_(field->grid),
        sums_(1, "sums of a loss") {
    REGRADE_CHECK(!field->grid.fitting);
    sums_.Zero();
  }

  AggregationResult Run(const LipschitzNetwork& network, const StyleRays& batch,
                        std::vector<double>* gradient) override {
    const DeviceRange range("loss of a step of the style");
    AggregationResult result = Touch(network, batch);
    const MlpPrecision precision =
        gradient != nullptr ? MlpPrecision::kTensor : MlpPrecision::kSplit;
    Forward(network, network.Effective<float>(), precision, true);
    if (gradient != nullptr) {
      const int64_t values = slots_.num_slots * stride_;
      Reserve(values, "gradients of styled voxels", &d_rows_);
      float* const sums = options_.exact_sums ? Exact(values, &exact_rows_) : d_rows_.data();
      DeviceZero(sums, (options_.exact_sums ? 2 : 1) * values * int64_t{sizeof(float)});
    }
    sums_.Zero();
    ForEachBand([&](int64_t begin, int64_t) {
      BlendBand(begin);
      if (gradient != nullptr)
        BlendColorsAdjoint(field_, weights_, slots_, rays_.data() + begin, unclamped_.data(),
                           d_color_.data(), d_rows_.data(), exact_rows_.data());
    });
    if (gradient != nullptr) {
      const Mat3f base = BaseOf(network.data()).matrix;
      ForEachBatch(network, [&](int64_t begin, int64_t count) {
        float* const d_rows = d_rows_.data() + begin * stride_;
        AddViewPenalty(field_.row(), base, features_.data(), rows_.data() + begin * stride_,
                       count, static_cast<float>(options_.view_weight), d_rows,
                       &sums_.data()->loss);
        mlp_->AddAdjoint(precision, features_.data(), d_rows, count);
      });
    }
    DeviceColorLoss sums;
    sums_.CopyOut(&sums, 1);
    result.rays = static_cast<int64_t>(sums.rays);
    result.squared_error = sums.squared_error;
    if (result.rays == 0) return result;
    const double count = options_.divide_by_voxels ? static_cast<double>(NumMapped(field_))
                                                   : 3.0 * static_cast<double>(result.rays);
    result.loss = sums.loss / count;
    if (gradient == nullptr) return result;
    DenseNetwork<double> d_effective;
    for (int l = 0; l < kNetworkLayers; ++l)
      d_effective.layers.emplace_back(network.Outputs(l), network.Inputs(l));
    mlp_->TakeGradient(&d_effective);
    std::vector<double> sum(gradient->size());
    network.AddGradient(d_effective, &sum);
    for (size_t i = 0; i < sum.size(); ++i) (*gradient)[i] += sum[i] / count;
    return result;
  }

  HiddenSums SumHidden(const LipschitzNetwork& network, const StyleRays& batch) override {
    Touch(network, batch);
    const int64_t n = static_cast<int64_t>(batch.rays.size());
    Forward(network, network.Effective<float>(), MlpPrecision::kSplit, true);
    std::vector<Vec3f> color(static_cast<size_t>(n));
    std::vector<float> transmittance(static_cast<size_t>(n));
    ForEachBand([&](int64_t begin, int64_t count) {
      BlendBand(begin);
      DeviceCopyOut(color.data() + begin, color_.data(), count * int64_t{sizeof(Vec3f)});
      weights_.transmittance.CopyOut(transmittance.data() + begin, count);
    });
    HiddenSums sums;
    std::vector<int64_t> counted;
    for (int64_t r = 0; r < n; ++r) {
      const Vec3f& target = batch.targets[static_cast<size_t>(r)];
      const float left = transmittance[static_cast<size_t>(r)];
      if (!AllFinite(target) || !(left <= options_.max_transmittance)) continue;
      counted.push_back(r);
      sums.opacity.push_back(1 - left);
      for (int c = 0; c < 3; ++c)
        sums.missing.push_back(target[c] - color[static_cast<size_t>(r)][c]);
    }
    sums.hidden.resize(counted.size() * kMlpHidden);
    std::vector<float> band(static_cast<size_t>(n * stride_));
    DeviceBuffer<float> of_rays(std::min(n, kBandRays) * stride_, "hidden sums of rays");
    for (int half = 0; half < kMlpHidden; half += stride_) {
      Forward(network, HiddenUnits(network, half), MlpPrecision::kSplit, false);
      ForEachBand([&](int64_t begin, int64_t count) {
        BlendRows(field_, weights_, slots_, rows_.data(), of_rays.data(),
                  Exact(count * stride_, &exact_sums_));
        of_rays.CopyOut(band.data() + begin * stride_, count * stride_);
      });
      for (size_t i = 0; i < counted.size(); ++i)
        std::copy_n(band.data() + counted[i] * stride_, stride_,
                    sums.hidden.data() + i * kMlpHidden + static_cast<size_t>(half));
    }
    return sums;
  }

 private:
  // Which voxels the rays touch.
  AggregationResult Touch(const LipschitzNetwork& network, const StyleRays& batch) {
    REGRADE_CHECK_EQ(network.row().stride(), stride_);
    batch_ = &batch;
    num_rays_ = static_cast<int64_t>(batch.rays.size());
    Reserve(num_rays_, "rays", &rays_);
    Reserve(num_rays_, "colours of rays", &targets_);
    rays_.CopyIn(batch.rays.data(), num_rays_);
    targets_.CopyIn(batch.targets.data(), num_rays_);
    AggregationResult result;
    if (options_.every_voxel) touched_.MarkAll();
    for (int64_t begin = 0; begin < num_rays_; begin += kBandRays) {
      March(begin, &touched_);
      result.samples += weights_.num_samples;
    }
    slots_.Assign(&touched_);
    result.touched_voxels = slots_.num_slots;
    Reserve(std::min(slots_.num_slots, options_.batch) * stride_, "features of a batch",
            &features_);
    Reserve(slots_.num_slots * stride_, "styled voxels", &rows_);
    return result;
  }

  // body(first slot, slots) with features_ of these.
  template <typename Body>
  void ForEachBatch(const LipschitzNetwork& network, const Body& body) {
    for (int64_t begin = 0; begin < slots_.num_slots; begin += options_.batch) {
      const int64_t count = std::min(options_.batch, slots_.num_slots - begin);
      GatherRows(field_, slots_.point_of_slot.data() + begin, 0, count,
                 network.data().position_scale, features_.data());
      body(begin, count);
    }
  }

  // rows_ of `layers` on the features of `network`, and its base map on top.
  void Forward(const LipschitzNetwork& network, const DenseNetwork<float>& layers,
               MlpPrecision precision, bool with_base) {
    const FusedMlp fused = MakeFusedMlp(layers);
    if (mlp_ == nullptr)
      mlp_ = std::make_unique<DeviceMlp>(fused);
    else
      mlp_->Set(fused);
    ForEachBatch(network, [&](int64_t begin, int64_t count) {
      float* const rows = rows_.data() + begin * stride_;
      mlp_->Forward(precision, features_.data(), count, rows);
      if (with_base) AddBaseMap(network.data(), features_.data(), count, rows);
    });
  }

  void March(int64_t begin, DeviceTouched* touched) {
    const int64_t n = std::min(kBandRays, num_rays_ - begin);
    if (field_.splats == nullptr) {
      weights_.March(field_.grid, rays_.data() + begin, n, options_.march, options_.min_weight,
                     touched);
      return;
    }
    field_.splats->Weigh({{batch_, begin, begin + n}}, n, options_.min_weight, &weighed_);
    weights_.Reserve(n, weighed_.most);
    TakeSamples(weighed_, nullptr, &weights_, touched);
    weights_.num_samples = weighed_.most;
  }

  // body(first ray, rays) with weights_ of each band; a single one has been marched already.
  template <typename Body>
  void ForEachBand(const Body& body) {
    for (int64_t begin = 0; begin < num_rays_; begin += kBandRays) {
      if (num_rays_ > kBandRays) March(begin, nullptr);
      body(begin, weights_.num_rays);
    }
  }

  // Room for integer sums of so many values; null without exact_sums.
  float* Exact(int64_t values, DeviceBuffer<float>* buffer) const {
    if (options_.exact_sums) Reserve(2 * values, "exact sums of the style", buffer);
    return buffer->data();
  }

  // Colours, loss and what goes back for the band that begins at ray `begin`.
  void BlendBand(int64_t begin) {
    Reserve(weights_.num_rays, "colours of rays", &color_);
    Reserve(weights_.num_rays, "gradients of colours", &d_color_);
    Reserve(weights_.num_samples, "clamps of samples", &unclamped_);
    BlendColors(field_, weights_, slots_, rays_.data() + begin, rows_.data(), color_.data(),
                unclamped_.data(), Exact(3 * weights_.num_rays, &exact_sums_));
    AddColorLoss(color_.data(), targets_.data() + begin, weights_.transmittance.data(),
                 weights_.num_rays, {options_.max_transmittance, options_.one_sided},
                 d_color_.data(), sums_.data());
  }

  const DeviceStyleField& field_;
  AggregationOptions options_;
  int stride_;  // of rows
  DeviceTouched touched_;
  DeviceSlots slots_;
  DeviceRayWeights weights_;
  DeviceSplatSamples weighed_;
  std::unique_ptr<DeviceMlp> mlp_;
  const StyleRays* batch_ = nullptr;  // of the call under way
  int64_t num_rays_ = 0;
  DeviceBuffer<Ray> rays_;
  DeviceBuffer<Vec3f> targets_, color_, d_color_;
  DeviceBuffer<uint8_t> unclamped_;
  DeviceBuffer<float> rows_, d_rows_;  // [slots, stride_]
  DeviceBuffer<float> features_;       // [slots of a batch, stride_]
  DeviceBuffer<float> exact_rows_, exact_sums_;
  DeviceBuffer<DeviceColorLoss> sums_;
};

}  // namespace

std::unique_ptr<StyleLoss> MakeDeviceStyleLoss(const DeviceStyleField* field,
                                               const AggregationOptions& options) {
  return std::make_unique<DeviceStyleLoss>(field, options);
}

void RestyleOnDevice(const LipschitzNetwork& network, DeviceStyleField* field) {
  const DeviceGrid& grid = field->grid;
  REGRADE_CHECK(!grid.fitting);
  REGRADE_CHECK_EQ(network.row().basis, field->row().basis);
  const DeviceRange range("restyling the field");
  constexpr int64_t kChunk = 1 << 20;  // points; 256 or 512 MiB of features and results
  const int64_t room = std::min(std::max(grid.num_voxels(), grid.spheres.num_texels()), kChunk);
  DeviceBuffer<float> features(room * field->row().stride(), "features of voxels");
  DeviceBuffer<float> rows(room * field->row().stride(), "styled voxels");
  const DeviceMlp mlp(MakeFusedMlp(network.Effective<float>()));
  const auto restyle = [&](int64_t first, int64_t end) {
    for (int64_t begin = first; begin < end; begin += kChunk) {
      const int64_t count = std::min(kChunk, end - begin);
      GatherRows(*field, nullptr, begin, count, network.data().position_scale, features.data());
      mlp.Forward(MlpPrecision::kSplit, features.data(), count, rows.data());
      AddBaseMap(network.data(), features.data(), count, rows.data());
      ScatterRows(rows.data(), begin, count, field);
    }
  };
  restyle(0, grid.num_voxels());
  if (grid.spheres.on()) restyle(grid.first_texel(), grid.num_points());
  DeviceWait("restyling the field");
}

}  // namespace regrade
