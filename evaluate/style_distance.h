// Distances of a sequence of frames to a style picture, by networks of the user.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "evaluate/feature_statistics.h"
#include "kernels/scene/image.h"

namespace regrade {

// What a network makes of a picture: moments of each of its outputs, or one vector.
using FeaturesFunction = std::function<std::vector<FeatureStatistics>(const Image&)>;
using EmbeddingFunction = std::function<std::vector<float>(const Image&)>;

// EQ(embedding-distance), Radford et al. 2021 compare pictures so: 1 - <a, b> / (|a| |b|), from
// 0 to 2; 1 where a vector is 0. Vectors of different length fail a check.
double EmbeddingDistance(const std::vector<float>& a, const std::vector<float>& b);

// A style picture as networks see it. Either function may be empty.
class StyleFeatures {
 public:
  StyleFeatures(FeaturesFunction features, EmbeddingFunction embedding, const Image& style);

 private:
  friend class StyleDistances;
  FeaturesFunction features_;
  EmbeddingFunction embedding_;
  std::vector<FeatureStatistics> statistics_;  // of each output
  std::vector<float> vector_;
};

// Of one sequence; frames are added one by one. Pixels that are not finite are black to the
// networks.
class StyleDistances {
 public:
  explicit StyleDistances(std::shared_ptr<const StyleFeatures> style)
      : style_(std::move(style)) {}
  void Add(const Image& frame);

  // Mean over frames of the sum over outputs of the distance of Gram matrices, see
  // EQ(gram-distance).
  std::optional<double> Gram() const;
  // Sum over outputs of the Fréchet distance between the features of all frames, pooled over
  // frames and positions, and those of the style picture: see EQ(frechet-distance).
  std::optional<double> Frechet() const;
  // Mean over frames of the distance of embeddings, see EQ(embedding-distance).
  std::optional<double> Embedding() const;

 private:
  std::shared_ptr<const StyleFeatures> style_;
  std::vector<FeatureStatistics> pooled_;
  double sum_gram_ = 0, sum_embedding_ = 0;
  int frames_ = 0;
};

// EQ(artfid-like), the form of ArtFID (Wright and Ommer 2022): (1 + mean LPIPS to the unstyled
// frames) (1 + Fréchet distance to the style picture).
double ArtFidLike(double lpips_to_unstyled, double frechet_to_style);

}  // namespace regrade
