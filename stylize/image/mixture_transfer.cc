#include "stylize/image/mixture_transfer.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "kernels/image/color_statistics.h"
#include "stylize/image/map_stylizer.h"
#include "stylize/image/mixture_transport.h"
#include "stylize/image/monge_kantorovich.h"
#include "stylize/image/sample_colors.h"

namespace regrade {
namespace {

constexpr uint64_t kSeed = 0x67;

class MixtureTransfer : public ViewStylizer {
 public:
  MixtureTransfer(const StyleOptions& options, const Image& style,
                  const std::vector<Vec3d>& scene, const std::vector<double>& heights)
      : options_(options) {
    std::vector<double> style_heights;
    const std::vector<Vec3d> colors =
        SampleColors(style, "the style picture", kMixtureSample, &style_heights);
    style_ = FitMixture(colors, options.parts, kSeed);
    scene_ = FitMixture(scene, options.parts, kSeed);
    if (options.height_weight > 0) {
      MeasureHeights(colors, style_heights, &style_);
      MeasureHeights(scene, heights, &scene_);
    }
    of_scene_ = MapFrom(scene_);
    const Mat3d& c = MeasureColor(style).covariance;
    flat_ = std::max({c(0, 0), c(1, 1), c(2, 2)}) <= kRoundingVariance;
  }

  Image Stylize(const Image& view, int view_index) const override {
    const std::string where = "view " + std::to_string(view_index);
    CountNotFinite(view, where);
    const MixtureMap map =
        options_.scene_wide
            ? of_scene_
            : MapFrom(AdaptMixture(scene_, SampleColors(view, where, kMixtureSample)));
    return MapView(view, std::cref(map));
  }

  std::string Name() const override { return options_.method; }
  std::vector<std::string> Notices() const override {
    std::vector<std::string> notices;
    if (flat_) notices.push_back(kFlatStyleNotice);
    if (of_scene_.slope_before > options_.max_slope)
      notices.push_back(
          Format("the map between all photos' colours and the style's would be steeper than "
                 "max-slope %.3g: the photos' colour groups are widened until it is %.2f",
                 options_.max_slope, of_scene_.slope));
    return notices;
  }

 private:
  MixtureMap MapFrom(const GaussianMixture& source) const {
    return ComputeMixtureMap(source, style_, options_.max_slope, options_.height_weight);
  }

  StyleOptions options_;
  GaussianMixture style_, scene_;
  MixtureMap of_scene_;
  bool flat_ = false;
};

}  // namespace

std::unique_ptr<ViewStylizer> MakeMixtureTransfer(const StyleOptions& options,
                                                  const Image& style,
                                                  const std::vector<Vec3d>& scene,
                                                  const std::vector<double>& heights) {
  REGRADE_CHECK(ParseStyleMethod(options).kind == StyleMethodKind::kGmm && !scene.empty());
  return std::make_unique<MixtureTransfer>(options, style, scene, heights);
}

}  // namespace regrade
