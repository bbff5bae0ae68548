#include "evaluate/style_distance.h"

#include <cmath>
#include <utility>

#include "kernels/base/error.h"

namespace regrade {

double EmbeddingDistance(const std::vector<float>& a, const std::vector<float>& b) {
  REGRADE_CHECK_EQ(a.size(), b.size());
  double aa = 0, bb = 0, ab = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    const double x = a[i], y = b[i];
    aa += x * x;
    bb += y * y;
    ab += x * y;
  }
  const double scale = std::sqrt(aa) * std::sqrt(bb);
  return scale > 0 ? 1 - ab / scale : 1;
}

StyleFeatures::StyleFeatures(FeaturesFunction features, EmbeddingFunction embedding,
                             const Image& style)
    : features_(std::move(features)), embedding_(std::move(embedding)) {
  if (features_) statistics_ = features_(style);
  if (embedding_) vector_ = embedding_(style);
}

void StyleDistances::Add(const Image& frame) {
  ++frames_;
  if (style_->features_) {
    const std::vector<FeatureStatistics> features = style_->features_(frame);
    REGRADE_CHECK_EQ(features.size(), style_->statistics_.size());
    pooled_.resize(features.size());
    for (size_t i = 0; i < features.size(); ++i) {
      sum_gram_ += GramDistance(features[i], style_->statistics_[i]);
      pooled_[i] += features[i];
    }
  }
  if (style_->embedding_)
    sum_embedding_ += EmbeddingDistance(style_->embedding_(frame), style_->vector_);
}

std::optional<double> StyleDistances::Gram() const {
  if (frames_ == 0 || !style_->features_) return std::nullopt;
  return sum_gram_ / frames_;
}

std::optional<double> StyleDistances::Frechet() const {
  if (frames_ == 0 || !style_->features_) return std::nullopt;
  double sum = 0;
  for (size_t i = 0; i < pooled_.size(); ++i)
    sum += FrechetDistance(pooled_[i], style_->statistics_[i]);
  return sum;
}

std::optional<double> StyleDistances::Embedding() const {
  if (frames_ == 0 || !style_->embedding_) return std::nullopt;
  return sum_embedding_ / frames_;
}

double ArtFidLike(double lpips_to_unstyled, double frechet_to_style) {
  return (1 + lpips_to_unstyled) * (1 + frechet_to_style);
}

}  // namespace regrade
