#include "stylize/field/gradient_aggregation.h"

#include <omp.h>

#include <algorithm>
#include <numeric>

#include "kernels/base/error.h"
#include "kernels/field/field_kind.h"
#include "kernels/field/trilinear.h"
#include "stylize/field/base_map.h"
#include "stylize/field/color_error.h"
#include "stylize/field/styled_ray.h"
#include "stylize/field/view_penalty.h"

namespace regrade {
namespace {

constexpr int64_t kBandRays = 16384;

}  // namespace

DenseNetwork<float> HiddenUnits(const LipschitzNetwork& network, int first) {
  DenseNetwork<float> hidden = network.Effective<float>();
  const int units = network.row().stride();
  hidden.layers.back() = DenseLayer<float>(units, kMlpHidden);
  for (int o = 0; o < units; ++o) hidden.layers.back().weight[o * kMlpHidden + first + o] = 1;
  return hidden;
}

// Rays [begin, end) of a batch and all that is derived of them.
struct GradientAggregation::Band {
  int64_t begin = 0, end = 0;
  RayWeights weights;
  std::vector<int32_t> slots;         // [samples, corners]; -1 at an empty corner
  std::vector<uint8_t> unclamped;     // [samples]: bit c is set where channel c is not clamped
  std::vector<Vec3f> color, d_color;  // [rays]; d_color without the loss's normalisation
};

GradientAggregation::GradientAggregation(const RadianceField& field,
                                         const AggregationOptions& options)
    : field_(field),
      options_(options),
      weigher_(MakeRayWeigher(*field.geometry, field.near_clip, options.march,
                              options.min_weight, kManyViews)),
      corners_(KindOf(*field.geometry).sample_points),
      row_(RowOf(field.appearance.basis)),
      vertex_of_voxel_(VertexOfVoxel(*field.geometry)),
      place_of_column_(PlaceOfColumn(field.geometry->spheres)),
      slot_of_point_(static_cast<size_t>(field.geometry->num_voxels() +
                                         field.geometry->spheres.num_texels()),
                     -1) {}

// Slots in the order of first touch: a function of the rays alone.
void GradientAggregation::Touch(Band* band) {
  band->slots.resize(band->weights.samples.size() * static_cast<size_t>(corners_));
  int32_t* slot = band->slots.data();
  for (const WeightedSample& sample : band->weights.samples) {
    int32_t points[8];
    CornerPoints(*field_.geometry, sample, points);
    for (int k = 0; k < corners_; ++k) {
      const int32_t point = points[k];
      if (point < 0) {
        *slot++ = -1;
        continue;
      }
      int32_t& known = slot_of_point_[point];
      if (known < 0) {
        known = static_cast<int32_t>(touched_.size());
        touched_.push_back(point);
      }
      *slot++ = known;
    }
  }
}

void GradientAggregation::TouchAll() {
  touched_.resize(slot_of_point_.size());
  for (size_t point = 0; point < touched_.size(); ++point)
    slot_of_point_[point] = touched_[point] = static_cast<int32_t>(point);
}

void GradientAggregation::March(const StyleRays& batch, int64_t begin, int64_t end,
                                Band* band) {
  band->begin = begin;
  band->end = end;
  band->weights = weigher_->Weigh(batch, begin, end);
  Touch(band);
}

void GradientAggregation::FillTouchedFeatures(float position_scale, int64_t begin,
                                              int64_t count) {
  const int64_t voxels = field_.geometry->num_voxels();
  features_.Resize(count * row_.stride());
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < count; ++i) {
    const int32_t point = touched_[begin + i];
    float* const row = features_.data() + i * row_.stride();
    if (point < voxels) {
      FillFeatures(field_, position_scale, point, vertex_of_voxel_[point], row);
    } else {
      const int64_t texel = point - voxels;
      const size_t column = static_cast<size_t>(texel / field_.geometry->spheres.layers);
      FillTexelFeatures(field_, position_scale, texel, place_of_column_[column], row);
    }
  }
}

template <typename Body>
void GradientAggregation::ForEachBatch(float position_scale, const Body& body) {
  const int64_t slots = std::ssize(touched_);
  for (int64_t begin = 0; begin < slots; begin += options_.batch) {
    const int64_t count = std::min(options_.batch, slots - begin);
    FillTouchedFeatures(position_scale, begin, count);
    body(begin, count);
  }
}

void GradientAggregation::RenderColors(const StyleRays& batch, Band* band) const {
  const RayWeights& weights = band->weights;
  band->unclamped.resize(weights.samples.size());
  band->color.resize(weights.num_rays());
#pragma omp parallel for schedule(dynamic, 64)
  for (int64_t r = 0; r < weights.num_rays(); ++r) {
    StyledRay ray(weights, band->slots, r, field_.appearance.basis,
                  batch.rays[band->begin + r].direction);
    band->color[r] = ByShape(corners_, row_,
                             [&](auto shape) {
                               return RenderStyled<decltype(shape)>(&ray, sh_.data(),
                                                                    band->unclamped.data());
                             }) +
                     field_.background * weights.transmittance[r];
  }
}

// Each range of slots walks all rays in their order, so a sum does not know who computed it.
void GradientAggregation::Scatter(const StyleRays& batch, const Band& band) {
  const RayWeights& weights = band.weights;
  const int64_t slots = std::ssize(touched_);
  const int ranges = omp_get_max_threads();
#pragma omp parallel for schedule(static, 1)
  for (int t = 0; t < ranges; ++t) {
    const int32_t begin = static_cast<int32_t>(slots * t / ranges);
    const int32_t end = static_cast<int32_t>(slots * (t + 1) / ranges);
    for (int64_t r = 0; r < weights.num_rays(); ++r) {
      const Vec3f& d_color = band.d_color[r];
      if (d_color == Vec3f{0, 0, 0}) continue;
      StyledRay ray(weights, band.slots, r, field_.appearance.basis,
                    batch.rays[band.begin + r].direction);
      ByShape(corners_, row_, [&](auto shape) {
        ScatterStyled<decltype(shape)>(&ray, band.unclamped.data(), d_color, begin, end,
                                       d_sh_.data());
      });
    }
  }
}

double GradientAggregation::AddViewPenalty(const LipschitzNetworkData& data, int64_t begin,
                                           int64_t count) {
  const RowMap map = BaseOf(data);
  std::vector<double> sums(count);  // summed up in order below
#pragma omp parallel for schedule(static)
  for (int64_t s = 0; s < count; ++s) {
    const float* const from = features_.data() + s * row_.stride();
    const float* const styled = sh_.data() + (begin + s) * row_.stride();
    float* const d = d_sh_.data() + (begin + s) * row_.stride();
    float* const mass = d + row_.mass();
    for (int c = 0; c < 3; ++c) {
      for (int k = 1; k < row_.basis; ++k) {
        const Vec3f source{from[k], from[row_.basis + k], from[2 * row_.basis + k]};
        const int at = c * row_.basis + k;
        const ViewPenalty<float> penalty =
            ViewPenaltyOf(mass[c], styled[at] - Dot(map.matrix.row[c], source));
        sums[s] += double{penalty.value};
        d[at] += static_cast<float>(options_.view_weight) * penalty.derivative;
      }
      mass[c] = 0;
    }
  }
  return options_.view_weight * std::accumulate(sums.begin(), sums.end(), 0.0);
}

bool GradientAggregation::Counts(const StyleRays& batch, const Band& band, int64_t ray) const {
  return AllFinite(batch.targets[band.begin + ray]) &&
         band.weights.transmittance[ray] <= options_.max_transmittance;
}

void GradientAggregation::ForgetTouched() {
  for (const int32_t point : touched_) slot_of_point_[point] = -1;
  touched_.clear();
}

AggregationResult GradientAggregation::Run(const LipschitzNetwork& network,
                                           const StyleRays& batch,
                                           std::vector<double>* gradient) {
  REGRADE_CHECK_EQ(network.row().basis, row_.basis);
  const int64_t num_rays = std::ssize(batch.rays);
  const bool one_band = num_rays <= kBandRays;
  AggregationResult result;
  Band band;
  if (options_.every_voxel) TouchAll();
  // Which voxels are touched. The lists of a whole view are large: marched again below.
  for (int64_t begin = 0; begin < num_rays; begin += kBandRays) {
    March(batch, begin, std::min(num_rays, begin + kBandRays), &band);
    result.samples += std::ssize(band.weights.samples);
  }
  const int64_t slots = std::ssize(touched_);
  result.touched_voxels = slots;
  const float position_scale = network.data().position_scale;
  sh_.Resize(slots * row_.stride());
  ForEachBatch(position_scale, [&](int64_t begin, int64_t count) {
    network.Forward(features_.data(), count, sh_.data() + begin * row_.stride());
  });
  if (gradient != nullptr) {
    d_sh_.Clear();
    d_sh_.Resize(slots * row_.stride());
  }

  double loss_sum = 0;
  for (int64_t begin = 0; begin < num_rays; begin += kBandRays) {
    if (!one_band) March(batch, begin, std::min(num_rays, begin + kBandRays), &band);
    RenderColors(batch, &band);
    band.d_color.assign(band.color.size(), Vec3f{0, 0, 0});
    for (int64_t r = 0; r < band.weights.num_rays(); ++r) {
      if (!Counts(batch, band, r)) continue;
      ++result.rays;
      const Vec3f& target = batch.targets[begin + r];
      for (int c = 0; c < 3; ++c) {
        const ColorError error = ErrorOf(band.color[r][c], target[c], options_.one_sided);
        loss_sum += static_cast<double>(error.loss) * error.loss;
        result.squared_error += static_cast<double>(error.shown) * error.shown;
        band.d_color[r][c] = 2 * error.loss;
      }
    }
    if (gradient != nullptr) Scatter(batch, band);
  }
  DenseNetwork<double> d_effective;
  if (gradient != nullptr) {
    for (int l = 0; l < kNetworkLayers; ++l)
      d_effective.layers.emplace_back(network.Outputs(l), network.Inputs(l));
    const FusedMlp fused = MakeFusedMlp(network.Effective<float>());
    ForEachBatch(position_scale, [&](int64_t begin, int64_t count) {
      loss_sum += AddViewPenalty(network.data(), begin, count);
      FusedAdjoint(fused, features_.data(), d_sh_.data() + begin * row_.stride(), count,
                   &d_effective);
    });
  }
  ForgetTouched();

  const double count = options_.divide_by_voxels
                           ? static_cast<double>(std::ssize(slot_of_point_))
                           : 3.0 * static_cast<double>(result.rays);
  if (result.rays == 0) return result;
  result.loss = loss_sum / count;
  if (gradient == nullptr) return result;

  std::vector<double> sum(gradient->size());
  network.AddGradient(d_effective, &sum);
  for (size_t i = 0; i < sum.size(); ++i) (*gradient)[i] += sum[i] / count;
  return result;
}

StyleLoss::HiddenSums GradientAggregation::SumHidden(const LipschitzNetwork& network,
                                                     const StyleRays& batch) {
  HiddenSums sums;
  const int64_t num_rays = std::ssize(batch.rays);
  Band band;
  for (int64_t begin = 0; begin < num_rays; begin += kBandRays) {
    March(batch, begin, std::min(num_rays, begin + kBandRays), &band);
    const RayWeights& weights = band.weights;
    const float position_scale = network.data().position_scale;
    sh_.Resize(std::ssize(touched_) * row_.stride());
    ForEachBatch(position_scale, [&](int64_t first, int64_t count) {
      network.Forward(features_.data(), count, sh_.data() + first * row_.stride());
    });
    RenderColors(batch, &band);
    const size_t row = sums.opacity.size();
    for (int64_t r = 0; r < weights.num_rays(); ++r) {
      if (!Counts(batch, band, r)) continue;
      sums.opacity.push_back(1 - weights.transmittance[r]);
      for (int c = 0; c < 3; ++c)
        sums.missing.push_back(batch.targets[begin + r][c] - band.color[r][c]);
    }
    sums.hidden.resize(sums.opacity.size() * kMlpHidden);
    for (int half = 0; half < kMlpHidden; half += row_.stride()) {
      const FusedMlp units = MakeFusedMlp(HiddenUnits(network, half));
      ForEachBatch(position_scale, [&](int64_t first, int64_t count) {
        FusedForward(units, features_.data(), count, sh_.data() + first * row_.stride());
      });
      size_t next = row;
      for (int64_t r = 0; r < weights.num_rays(); ++r) {
        if (!Counts(batch, band, r)) continue;
        float* out = &sums.hidden[next++ * kMlpHidden + static_cast<size_t>(half)];
        for (int64_t i = weights.first[r]; i < weights.first[static_cast<size_t>(r) + 1]; ++i)
          for (int corner = 0; corner < corners_; ++corner) {
            const int32_t slot = band.slots[i * corners_ + corner];
            if (slot < 0) continue;
            const WeightedSample& sample = weights.samples[i];
            const float w = sample.weight * CornerWeight(sample.fraction, corner);
            const float* h = sh_.data() + static_cast<int64_t>(slot) * row_.stride();
            for (int l = 0; l < row_.stride(); ++l) out[l] += w * h[l];
          }
      }
    }
    ForgetTouched();
  }
  return sums;
}

}  // namespace regrade
