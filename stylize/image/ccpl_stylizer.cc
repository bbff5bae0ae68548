#include "stylize/image/ccpl_stylizer.h"

#include <cmath>
#include <vector>

#include "kernels/base/error.h"
#include "stylize/image/network_pictures.h"
#include "stylize/image/onnx_network.h"

namespace regrade {
namespace {

constexpr double kVarianceFloor = 1e-5;
constexpr int kSpare = 7;           // rows and columns that three halvings round up
constexpr int kSmallestStyle = 40;  // pixels: 5 at an eighth, of which "style" cuts 4 off

// (f - mean) * scale, channel by channel.
FeatureMap Moved(const FeatureMap& features, const std::vector<double>& mean,
                 const std::vector<double>& scale) {
  FeatureMap moved(features.channels, features.height, features.width);
  for (int c = 0; c < features.channels; ++c) {
    const size_t k = static_cast<size_t>(c);
    for (int64_t i = 0; i < features.num_pixels(); ++i)
      moved.plane(c)[i] = static_cast<float>((features.plane(c)[i] - mean[k]) * scale[k]);
  }
  return moved;
}

class Ccpl : public ViewStylizer {
 public:
  Ccpl(const std::string& folder, int max_side, const Image& style)
      : max_side_(max_side),
        encoder_(folder + "/ccpl_encoder.onnx"),
        content_(folder + "/ccpl_content.onnx"),
        style_network_(folder + "/ccpl_style.onnx"),
        expand_(folder + "/ccpl_expand.onnx"),
        decoder_(folder + "/ccpl_decoder.onnx") {
    // Files that do not fit each other are found before a large picture is begun.
    const Image trial = TrialPicture(kSmallestStyle + 3, kSmallestStyle);
    LearnStyle(trial);
    Restyled(trial);
    LearnStyle(Working(Colors(style), max_side_, 1, kSmallestStyle));
  }

  Image Stylize(const Image& view, int view_index) const override {
    return StyledAtWorkingSize(view, view_index, max_side_,
                               [this](const Image& photo) { return Restyled(photo); });
  }

  std::string Name() const override { return "ccpl"; }

 private:
  void LearnStyle(const Image& style) {
    const FeatureMap map = MapOf(style);
    const FeatureMap features = encoder_.Run({{"image", &map}}, {"feat"})[0];
    const FeatureMap centered = CenteredFeatures(features);
    style_.mean = MeasureFeatures(features).mean;
    style_.moments = SecondMoments(style_network_.Run({{"feat", &centered}}, {"code"})[0]);
  }

  Image Restyled(const Image& photo) const {
    const FeatureMap map = MapOf(photo);
    const FeatureMap features =
        NormalizedFeatures(encoder_.Run({{"image", &map}}, {"feat"})[0]);
    FeatureMap code = content_.Run({{"feat", &features}}, {"code"})[0];
    CheckShape(code, style_.moments.channels, features.height, features.width, content_.path());
    Apply(style_.moments, &code);
    FeatureMap x = expand_.Run({{"code", &code}}, {"feat"})[0];
    CheckShape(x, features.channels, features.height, features.width, expand_.path());
    AddMean(style_.mean, &x);
    return ClippedImageOf(Cropped(decoder_.Run({{"feat", &x}}, {"image"})[0], photo.width,
                                  photo.height, kSpare, decoder_.path()));
  }

  int max_side_;
  OnnxNetwork encoder_, content_, style_network_, expand_, decoder_;
  SimpleCovarianceStyle style_;
};

}  // namespace

FeatureMap NormalizedFeatures(const FeatureMap& features) {
  const FeatureStatistics statistics = MeasureFeatures(features, 1);
  const size_t n = static_cast<size_t>(features.channels);
  std::vector<double> scale(n);
  for (size_t c = 0; c < n; ++c)
    scale[c] = 1 / std::sqrt(statistics.covariance[c * n + c] + kVarianceFloor);
  return Moved(features, statistics.mean, scale);
}

FeatureMap CenteredFeatures(const FeatureMap& features) {
  return Moved(features, MeasureFeatures(features).mean,
               std::vector<double>(static_cast<size_t>(features.channels), 1.0));
}

FeatureAffine SecondMoments(const FeatureMap& code) {
  const FeatureStatistics statistics = MeasureFeatures(code);
  const size_t n = static_cast<size_t>(code.channels);
  FeatureAffine moments{code.channels, statistics.covariance, std::vector<double>(n)};
  for (size_t i = 0; i < n; ++i)
    for (size_t j = 0; j < n; ++j)
      moments.matrix[i * n + j] += statistics.mean[i] * statistics.mean[j];
  return moments;
}

void AddMean(const std::vector<double>& mean, FeatureMap* features) {
  REGRADE_CHECK_EQ(mean.size(), static_cast<size_t>(features->channels));
  for (int c = 0; c < features->channels; ++c)
    for (int64_t i = 0; i < features->num_pixels(); ++i)
      features->plane(c)[i] = static_cast<float>(features->plane(c)[i] + mean[c]);
}

std::unique_ptr<ViewStylizer> MakeCcplStylizer(const std::string& folder, int max_side,
                                               const Image& style) {
  return std::make_unique<Ccpl>(folder, max_side, style);
}

}  // namespace regrade
