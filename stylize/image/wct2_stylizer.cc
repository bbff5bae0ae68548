#include "stylize/image/wct2_stylizer.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>
#include <vector>

#include "stylize/image/feature_transform.h"
#include "stylize/image/network_pictures.h"
#include "stylize/image/onnx_network.h"

namespace regrade {
namespace {

constexpr WhiteningRule kRule{1, 1e-5};
constexpr int kWct2Multiple = 8;  // three halvings
constexpr int kLevels = 4;
constexpr std::array kBands = {"lh", "hl", "hh"};

std::string Prefix(bool cat5) { return cat5 ? "wct2_cat5_" : "wct2_sum_"; }

class Wct2 : public ViewStylizer {
 public:
  Wct2(const std::string& folder, bool cat5, int max_side, const Image& style)
      : cat5_(cat5), max_side_(max_side) {
    for (int level = 1; level <= kLevels; ++level) {
      encoders_.emplace_back(Numbered(folder, Prefix(cat5) + "encoder", level));
      decoders_.emplace_back(Numbered(folder, Prefix(cat5) + "decoder", level));
    }
    // Files that do not fit each other are found before a large picture is begun.
    const Image trial = TrialPicture(4 * kWct2Multiple, 3 * kWct2Multiple);
    Restyle(MapOf(trial), [this](const std::string& place, FeatureMap* x) {
      style_[place] = MeasureFeatures(*x, 1);
    });
    Restyled(trial);
    style_.clear();
    const FeatureMap picture =
        Padded(MapOf(Working(Colors(style), max_side_, 1)), kWct2Multiple);
    Restyle(picture, [this](const std::string& place, FeatureMap* x) {
      style_[place] = MeasureFeatures(*x, 1);
    });
  }

  Image Stylize(const Image& view, int view_index) const override {
    return StyledAtWorkingSize(view, view_index, max_side_,
                               [this](const Image& photo) { return Restyled(photo); });
  }

  std::string Name() const override { return cat5_ ? "wct2-cat5" : "wct2-sum"; }

 private:
  // What passes over the bottleneck, from an encoder to a decoder.
  struct Bypass {
    FeatureMap skip;                  // with cat5
    std::array<FeatureMap, 3> bands;  // of kBands
  };

  Image Restyled(const Image& photo) const {
    const FeatureMap map = MapOf(photo);
    return ClippedImageOf(Cropped(
        Restyle(Padded(map, kWct2Multiple),
                [this](const std::string& place, FeatureMap* x) { Transform(place, x); }),
        photo.width, photo.height, kWct2Multiple - 1, decoders_[0].path()));
  }

  void Transform(const std::string& place, FeatureMap* x) const {
    const FeatureStatistics& style = style_.at(place);
    const auto [low, high] = std::minmax_element(x->values.begin(), x->values.end());
    const float least = *low, most = *high;
    Apply(WhitenAndColor(MeasureFeatures(*x, 1), style, kRule), x);
    for (float& value : x->values) value = std::clamp(value, least, most);
  }

  // There and back; `at` sees, and may change, the features at each place where WCT2 does so.
  template <typename At>
  FeatureMap Restyle(FeatureMap x, const At& at) const {
    std::array<Bypass, kLevels + 1> over;  // [decoder's level]
    for (int level = 1; level <= kLevels; ++level) {
      const OnnxNetwork& encoder = encoders_[level - 1];
      const size_t taker = static_cast<size_t>(cat5_ ? level : level + 1);
      const bool halves = taker >= 2 && taker <= kLevels;
      std::vector<std::string> outputs = {"out"};
      if (halves) outputs.insert(outputs.end(), kBands.begin(), kBands.end());
      if (halves && cat5_) outputs.push_back("skip");
      const int height = x.height, width = x.width;
      std::vector<FeatureMap> parts =
          encoder.Run({{level == 1 ? "image" : "feat", &x}}, outputs);
      encoder.GiveBackMemory();
      x = std::move(parts[0]);
      CheckShape(x, x.channels, halves ? height / 2 : height, halves ? width / 2 : width,
                 encoder.path());
      if (halves) {
        for (size_t band = 0; band < kBands.size(); ++band) {
          CheckShape(parts[band + 1], parts[1].channels, x.height, x.width, encoder.path());
          over[taker].bands[band] = std::move(parts[band + 1]);
        }
        if (cat5_) {
          CheckShape(parts[4], over[taker].bands[0].channels, height, width, encoder.path());
          over[taker].skip = std::move(parts[4]);
        }
      }
      at("encoder" + std::to_string(level), &x);
    }
    for (size_t level = 2; level <= kLevels; ++level)
      for (size_t band = 0; band < kBands.size(); ++band)
        at(kBands[band] + std::to_string(level), &over[level].bands[band]);
    for (size_t level = kLevels; level >= 1; --level) {
      const OnnxNetwork& decoder = decoders_[level - 1];
      if (cat5_ && level < kLevels) at("decoder" + std::to_string(level), &x);
      std::vector<OnnxNetwork::Input> inputs = {{"feat", &x}};
      if (level >= 2) {
        for (size_t band = 0; band < kBands.size(); ++band)
          inputs.emplace_back(kBands[band], &over[level].bands[band]);
        if (cat5_) inputs.emplace_back("skip", &over[level].skip);
      }
      const int times = level >= 2 ? 2 : 1, height = x.height * times, width = x.width * times;
      x = std::move(decoder.Run(inputs, {level == 1 ? "image" : "out"})[0]);
      decoder.GiveBackMemory();
      CheckShape(x, level == 1 ? 3 : x.channels, height, width, decoder.path());
      over[level] = {};
    }
    return x;
  }

  bool cat5_;
  int max_side_;
  std::vector<OnnxNetwork> encoders_, decoders_;    // [level - 1]
  std::map<std::string, FeatureStatistics> style_;  // of the places that `at` is given
};

}  // namespace

std::unique_ptr<ViewStylizer> MakeWct2Stylizer(const std::string& folder, bool cat5,
                                               int max_side, const Image& style) {
  return std::make_unique<Wct2>(folder, cat5, max_side, style);
}

std::string Wct2FirstFile(bool cat5) { return Prefix(cat5) + "encoder1.onnx"; }

}  // namespace regrade
