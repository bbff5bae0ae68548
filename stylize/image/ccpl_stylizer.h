// CCPL (Wu et al. 2022): features meet the style's second moments in a narrow space.
#pragma once

#include <memory>
#include <string>

#include "stylize/image/feature_map.h"
#include "stylize/image/feature_transform.h"
#include "stylize/image/view_stylizer.h"

namespace regrade {

// What EQ(simple-covariance) needs of a style.
struct SimpleCovarianceStyle {
  std::vector<double> mean;  // m_s, of the encoder's features
  FeatureAffine moments;     // M
};

// EQ(simple-covariance), Wu et al. 2022, Sec. 3.3: features f of a photo become
//   e(M c((f - m) / s)) + m_s,  M = mean of g g^T over the pixels of g = k(f_s - m_s),
// with mean m and spread s = sqrt(variance of n - 1, plus 1e-5) of each channel of f, features
// f_s of the style with mean m_s, and three small networks: c ("content") and k ("style") into
// the narrow space, e ("expand") out of it. Means, moments and products in double. M is about
// 0, not about the mean of g.
FeatureMap NormalizedFeatures(const FeatureMap& features);
FeatureMap CenteredFeatures(const FeatureMap& features);
FeatureAffine SecondMoments(const FeatureMap& code);
void AddMean(const std::vector<double>& mean, FeatureMap* features);

// The folder holds ccpl_encoder.onnx (image -> feat), ccpl_content.onnx and ccpl_style.onnx
// (feat -> code), ccpl_expand.onnx (code -> feat) and ccpl_decoder.onnx (feat -> image), as
// scripts/convert_networks.py makes them of the photorealistic model or of the artistic one.
//
// Works at the photo's size and has no filter then; a photo whose longer side is above
// `max_side` is worked on small and its result brought to the photo's size and edges by
// WithEdgesOf. The networks are tried on a small picture first; what does not fit is
// Error(kExternalProgram) naming the file.
std::unique_ptr<ViewStylizer> MakeCcplStylizer(const std::string& folder, int max_side,
                                               const Image& style);

}  // namespace regrade
