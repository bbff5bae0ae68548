// Distances of a sequence of frames to a style picture, by networks of the user.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "evaluate/feature_statistics.h"
#include "evaluate/image_network.h"
#include "kernels/scene/image.h"

namespace regrade {

// A style picture as networks see it. Either network may be null.
class StyleFeatures {
 public:
  StyleFeatures(std::shared_ptr<const ImageNetwork> features,
                std::shared_ptr<const ImageNetwork> embedding, const Image& style);

 private:
  friend class StyleDistances;
  std::shared_ptr<const ImageNetwork> features_, embedding_;
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
