// Moves mean and covariance of a network's features onto a style's: whitening, then colouring.
#pragma once

#include <vector>

#include "stylize/image/feature_map.h"

namespace regrade {

// Over the pixels of a map: mean [channels] and covariance [channels, channels].
struct FeatureStatistics {
  int channels = 0;
  std::vector<double> mean;
  std::vector<double> covariance;
};

// Two passes in double, block by block in a fixed order. The sum of squares is divided by n -
// `fewer`; a single pixel has covariance 0.
FeatureStatistics MeasureFeatures(const FeatureMap& features, int fewer = 0);

// How a recipe treats directions in which features do not vary. Published networks have dead
// channels, so covariances are singular as a rule, and photos of one colour make them 0.
struct WhiteningRule {
  double ridge = 0;  // added to every eigenvalue of both covariances, before the root
  double drop = 0;   // eigenvalues up to this, ridge included, count as 0 on both sides
};

// v -> matrix v + offset for every pixel's vector v.
struct FeatureAffine {
  int channels = 0;
  std::vector<double> matrix;  // [channels, channels]
  std::vector<double> offset;  // [channels]
};

// EQ(whitening-coloring), Li et al. 2017 ("zca" in PCA-KD): v -> A (v - m_c) + m_s with
//   A = (S + r 1)^1/2 (C + r 1)^-1/2,
// C, m_c of the content, S, m_s of the style, r the ridge, each power by eigenvectors in
// double. A power of an eigenvalue that is dropped is 0, never infinite; rounding below 0
// counts as 0. `strength` in [0, 1] mixes with the identity.
FeatureAffine WhitenAndColor(const FeatureStatistics& content, const FeatureStatistics& style,
                             const WhiteningRule& rule, double strength = 1);

// EQ(cholesky-coloring), Wen et al. 2023 (cWCT): v -> L_S L_C^-1 (v - m_c) + m_s, symbols as
// above, C = L_C L_C^T and S = L_S L_S^T with lower triangular L. Where a covariance is
// singular in double, 2e-5, 4e-5, ... is added to its diagonal until it is not.
FeatureAffine CholeskyColor(const FeatureStatistics& content, const FeatureStatistics& style);

void Apply(const FeatureAffine& affine, FeatureMap* features);

}  // namespace regrade
