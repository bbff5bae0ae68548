#include "pipeline/stages/matched_stylizer.h"

#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/images/cube_file.h"
#include "stylize/image/masked_stylizer.h"
#include "stylize/image/region_features.h"
#include "stylize/image/region_match.h"

namespace regrade {
namespace {

constexpr double kLeastWeight = 0.01;  // of the scene, below which a style has no region

std::string FileName(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

constexpr char kUseMasks[] =
    "put the pictures side by side into one, and say with --masks and --style-mask which part "
    "of it goes where";

void RequireClear(const RegionMatch& match, const std::vector<std::string>& pictures) {
  for (size_t j = 0; j < pictures.size(); ++j)
    if (match.weight_of_style[j] < kLeastWeight)
      throw InputError("no region of the scene looks like it more than like the others",
                       pictures[j], Concat("leave it out, or ", kUseMasks));
  if (match.Unsure() > kMostUnsure)
    throw InputError(
        Format(
            "the regions of %.0f %% of the scene look alike to two of the pictures (a margin "
            "below %.2f; at most %.0f %% may)",
            100 * match.Unsure(), kLeastMargin, 100 * kMostUnsure),
        "--match regions", kUseMasks);
}

std::string Notice(const RegionMatch& match, const std::vector<std::string>& pictures) {
  std::string text;
  for (size_t j = 0; j < pictures.size(); ++j)
    text += (j > 0 ? ", " : "") + Format("%.0f %% like ", 100 * match.weight_of_style[j]) +
            FileName(pictures[j]);
  return Format("regions of the scene: %s; the least margin is %.2f", text.c_str(),
                match.Margin());
}

}  // namespace

std::unique_ptr<ViewStylizer> MakeMatchedStylizer(const StyleSource& style, size_t views,
                                                  const PhotoFunction& photo, bool of_colors,
                                                  const MethodMaker& make) {
  std::vector<Image> examples;
  for (const std::string& path : style.pictures)
    examples.push_back(StyleExample(path, nullptr));
  const auto features = std::make_shared<const RegionFeatures>(style.match.Network(), examples);
  std::vector<PictureFeatures> of_styles, of_photos;
  for (const Image& example : examples) of_styles.push_back(features->Of(example));
  for (size_t i = 0; i < views; ++i)
    if (const std::optional<Image> picture = photo(i))
      of_photos.push_back(features->Of(*picture));
  if (of_photos.empty())
    throw InputError("the photos' masks leave nothing of the scene", "--photo-masks",
                     "check the masks");
  const auto match = std::make_shared<const RegionMatch>(MatchRegions(of_photos, of_styles));
  RequireClear(*match, style.pictures);

  std::vector<std::unique_ptr<ViewStylizer>> regions;
  for (size_t j = 0; j < examples.size(); ++j)
    regions.push_back(
        make(style.pictures[j], examples[j], [&, j](size_t i) -> std::optional<Image> {
          const std::optional<Image> picture = photo(i);
          if (!picture) return std::nullopt;
          const Image region = RegionCoverage(*match, *features, *picture)[j];
          if (!ShowsRegion(region)) return std::nullopt;
          return WithRegion(*picture, region);
        }));
  return MakeMaskedStylizer(std::move(regions), of_colors,
                            [match, features](const Image& view, int) {
                              return RegionCoverage(*match, *features, view);
                            },
                            {Notice(*match, style.pictures)});
}

}  // namespace regrade
