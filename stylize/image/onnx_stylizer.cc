#include "stylize/image/onnx_stylizer.h"

#include <algorithm>
#include <filesystem>
#include <utility>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"
#include "stylize/image/capvst_stylizer.h"
#include "stylize/image/ccpl_stylizer.h"
#include "stylize/image/feature_transform.h"
#include "stylize/image/network_pictures.h"
#include "stylize/image/onnx_network.h"
#include "stylize/image/wct2_stylizer.h"

namespace regrade {
namespace {

constexpr WhiteningRule kPcaKdRule{1, 1e-5};
constexpr WhiteningRule kWctRule{0, 1e-5};
constexpr double kWctStrength = 0.6;  // of the original's sample pictures

class PcaKd : public ViewStylizer {
 public:
  PcaKd(const std::string& folder, int max_side, const Image& style)
      : max_side_(max_side), encoder_(folder + "/encoder.onnx") {
    for (int level = 1; level <= 4; ++level)
      decoders_.emplace_back(Numbered(folder, "decoder", level));
    // A small picture as its own style: files that do not fit each other are found before a
    // large one is begun.
    constexpr int kTrial = 32;
    Image trial(kTrial, kTrial);
    for (size_t i = 0; i < trial.pixels.size(); ++i)
      trial.pixels[i] = static_cast<float>(i * 37 % 256) / 255.0f;
    const FeatureMap map = MapOf(trial);
    const FeatureMap deepest = encoder_.Run({{"image", &map}}, {"f4"})[0];
    multiple_ = kTrial / std::max(1, deepest.height);
    CheckShape(deepest, deepest.channels, kTrial / multiple_, kTrial / multiple_,
               encoder_.path());
    LearnStyle(trial);
    Restyle(trial);
    LearnStyle(Working(Colors(style), max_side_, multiple_));
  }

  Image Stylize(const Image& view, int view_index) const override {
    CountNotFinite(view, "view " + std::to_string(view_index));
    const Image photo = Colors(view);
    const Image small = Working(photo, max_side_, multiple_);
    const Image styled = Restyle(small);
    return WithColors(view, WithEdgesOf(photo, small, styled));
  }

  std::string Name() const override { return "pca-kd"; }

 private:
  void LearnStyle(const Image& style) {
    const FeatureMap map = MapOf(style);
    const std::vector<FeatureMap> features =
        encoder_.Run({{"image", &map}}, {"f1", "f2", "f3", "f4"});
    style_.clear();
    for (const FeatureMap& level : features) style_.push_back(MeasureFeatures(level));
  }

  Image Restyle(const Image& photo) const {
    const FeatureMap map = MapOf(photo);
    std::vector<FeatureMap> parts =
        encoder_.Run({{"image", &map}}, {"s1", "s2", "s3", "s4", "f4"});
    FeatureMap x = std::move(parts[4]);
    for (int level = 4; level >= 1; --level) {
      const size_t i = static_cast<size_t>(level - 1);
      Apply(WhitenAndColor(MeasureFeatures(x), style_[i], kPcaKdRule), &x);
      x = std::move(decoders_[i].Run({{"feat", &x}, {"skip", &parts[i]}}, {"out"})[0]);
      const int channels = level > 1 ? style_[i - 1].channels : 3;
      CheckShape(x, channels, parts[i].height, parts[i].width, decoders_[i].path());
    }
    return ClippedImageOf(x);
  }

  int max_side_;
  int multiple_ = 1;  // of the sides: what the encoder halves to
  OnnxNetwork encoder_;
  std::vector<OnnxNetwork> decoders_;     // [level - 1]
  std::vector<FeatureStatistics> style_;  // [level - 1]
};

class Wct : public ViewStylizer {
 public:
  Wct(const std::string& folder, int max_side, const Image& style) : max_side_(max_side) {
    for (int level = 1; level <= 3; ++level) {
      encoders_.emplace_back(Numbered(folder, "encoder", level));
      decoders_.emplace_back(Numbered(folder, "decoder", level));
    }
    const FeatureMap map = MapOf(Working(Colors(style), max_side_, 1));
    for (const OnnxNetwork& encoder : encoders_)
      style_.push_back(MeasureFeatures(encoder.Run({{"image", &map}}, {"feat"})[0], 1));
  }

  Image Stylize(const Image& view, int view_index) const override {
    CountNotFinite(view, "view " + std::to_string(view_index));
    FeatureMap x = MapOf(Working(Colors(view), max_side_, 1));
    const int width = x.width, height = x.height;
    for (int i = 2; i >= 0; --i) {
      FeatureMap f = encoders_[i].Run({{"image", &x}}, {"feat"})[0];
      CheckShape(f, style_[i].channels, f.height, f.width, encoders_[i].path());
      Apply(WhitenAndColor(MeasureFeatures(f, 1), style_[i], kWctRule, kWctStrength), &f);
      x = Cropped(decoders_[i].Run({{"feat", &f}}, {"image"})[0], width, height, 3,
                  decoders_[i].path());
    }
    return WithColors(view, Resize(ClippedImageOf(x), view.width, view.height));
  }

  std::string Name() const override { return "wct"; }

 private:
  int max_side_;
  std::vector<OnnxNetwork> encoders_, decoders_;  // [level - 1]
  std::vector<FeatureStatistics> style_;          // [level - 1]
};

}  // namespace

std::unique_ptr<ViewStylizer> MakeOnnxStylizer(const std::string& path, int max_side,
                                               const Image& style) {
  namespace fs = std::filesystem;
  std::error_code error;
  std::string folder = path;
  if (!fs::is_directory(path, error)) {
    const OnnxNetwork alone(path);
    folder = fs::path(path).parent_path().string();
    if (folder.empty()) folder = ".";
    if (fs::path(path).filename().string().find("encoder") == std::string::npos)
      throw ProgramError(
          "one network alone is no method known here", path,
          "name the folder that holds all networks of a method, such as PCA-KD's encoder.onnx "
          "and decoder1.onnx ... decoder4.onnx");
  }
  if (fs::exists(folder + "/encoder.onnx", error))
    return std::make_unique<PcaKd>(folder, max_side, style);
  if (fs::exists(folder + "/encoder3.onnx", error))
    return std::make_unique<Wct>(folder, max_side, style);
  for (const bool cat5 : {true, false})
    if (fs::exists(folder + "/" + Wct2FirstFile(cat5), error))
      return MakeWct2Stylizer(folder, cat5, max_side, style);
  if (fs::exists(folder + "/ccpl_encoder.onnx", error))
    return MakeCcplStylizer(folder, max_side, style);
  if (fs::exists(folder + "/" + kCapVstFirstFile, error))
    return MakeCapVstStylizer(folder, max_side, style);
  throw ProgramError(
      "there is no encoder.onnx in this folder", folder,
      "PCA-KD is encoder.onnx and decoder1.onnx ... decoder4.onnx, WCT encoder1.onnx ... "
      "encoder3.onnx and decoder1.onnx ... decoder3.onnx; scripts/convert_networks.py makes "
      "the files of WCT2, CCPL and CAP-VSTNet");
}

}  // namespace regrade
