#include "reconstruct/colmap/pose_weights.h"

#include <algorithm>
#include <cmath>

#include "reconstruct/colmap/listed_pairs.h"

namespace regrade {
namespace {

double Megapixels(const std::vector<StagedPhoto>& photos, int image_size) {
  double sum = 0;
  for (const StagedPhoto& photo : photos) {
    const double longer = std::max({photo.width, photo.height, 1});
    const double scale = std::min(1.0, image_size / longer);
    sum += 1e-6 * photo.width * photo.height * scale * scale;
  }
  return sum;
}

}  // namespace

// Fitted to six captures of 8 to 50 photos: extraction is proportional to the pixels (four
// times as many from octave -1 on), matching to the square of the features.
PoseWeights EstimateWeights(const PoseStrategy& strategy,
                            const std::vector<StagedPhoto>& photos, int image_size) {
  const double n = static_cast<double>(photos.size());
  const bool many = strategy.pairing == Pairing::kSimilar ||
                    (strategy.pairing == Pairing::kListed && !HasClips(photos));
  const double pairs =
      strategy.pairing == Pairing::kAll ? n * (n - 1) / 2 : std::min(many ? 30.0 : 10.0, n) * n;
  const double size = strategy.max_features / 2048.0;
  const double pixels = Megapixels(photos, image_size) * (strategy.first_octave < 0 ? 4 : 1);
  return {strategy.keep_matches ? 0 : 0.27 * pixels,
          strategy.keep_matches ? 0 : 0.07 * pairs * size * size, 0.4 * n * std::sqrt(size),
          0.04 * n * std::sqrt(size)};
}

}  // namespace regrade
