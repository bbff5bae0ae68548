#include "stylize/image/capvst_stylizer.h"

#include <utility>

#include "stylize/image/feature_transform.h"
#include "stylize/image/network_pictures.h"
#include "stylize/image/onnx_network.h"

namespace regrade {
namespace {

constexpr int kMultiple = 4;  // two halvings

class CapVst : public ViewStylizer {
 public:
  CapVst(const std::string& folder, int max_side, const Image& style)
      : max_side_(max_side),
        encoder_(folder + "/" + kCapVstFirstFile),
        decoder_(folder + "/capvst_decoder.onnx") {
    // Files that do not fit each other are found before a large picture is begun.
    const Image trial = TrialPicture(8 * kMultiple, 6 * kMultiple);
    style_ = MeasureFeatures(CodeOf(trial), 1);
    Restyled(trial);
    style_ = MeasureFeatures(CodeOf(Working(Colors(style), max_side_, 1)), 1);
  }

  Image Stylize(const Image& view, int view_index) const override {
    return StyledAtWorkingSize(view, view_index, max_side_,
                               [this](const Image& photo) { return Restyled(photo); });
  }

  std::string Name() const override { return "cap-vstnet"; }

 private:
  FeatureMap CodeOf(const Image& picture) const {
    const FeatureMap map = Padded(MapOf(picture), kMultiple);
    FeatureMap code = std::move(encoder_.Run({{"image", &map}}, {"code"})[0]);
    encoder_.GiveBackMemory();
    const int scale = code.height > 0 ? map.height / code.height : 0;
    CheckShape(code, code.channels, scale == 1 ? map.height : map.height / 2,
               scale == 1 ? map.width : map.width / 2, encoder_.path());
    return code;
  }

  Image Restyled(const Image& photo) const {
    FeatureMap code = CodeOf(photo);
    Apply(CholeskyColor(MeasureFeatures(code, 1), style_), &code);
    const FeatureMap image = std::move(decoder_.Run({{"code", &code}}, {"image"})[0]);
    decoder_.GiveBackMemory();
    return ClippedImageOf(
        Cropped(image, photo.width, photo.height, kMultiple - 1, decoder_.path()));
  }

  int max_side_;
  OnnxNetwork encoder_, decoder_;
  FeatureStatistics style_;
};

}  // namespace

std::unique_ptr<ViewStylizer> MakeCapVstStylizer(const std::string& folder, int max_side,
                                                 const Image& style) {
  return std::make_unique<CapVst>(folder, max_side, style);
}

}  // namespace regrade
