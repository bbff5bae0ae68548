#include "stylize/image/region_match.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"
#include "stylize/image/guided_filter.h"
#include "stylize/image/view_stylizer.h"

namespace regrade {
namespace {

constexpr uint64_t kMatchSeed = 0x72;
constexpr int64_t kMostRows = 20000;  // of all photos: a mixture needs no more

FeatureRows Sample(const std::vector<PictureFeatures>& pictures) {
  int64_t all = 0;
  for (const PictureFeatures& picture : pictures) all += picture.rows.rows();
  const int64_t stride = std::max<int64_t>(1, all / kMostRows);
  FeatureRows sample{pictures[0].rows.dimensions, {}};
  int64_t at = 0;
  for (const PictureFeatures& picture : pictures)
    for (int64_t i = 0; i < picture.rows.rows(); ++i, ++at)
      if (at % stride == 0) {
        const float* row = &picture.rows.values[static_cast<size_t>(i * sample.dimensions)];
        sample.values.insert(sample.values.end(), row, row + sample.dimensions);
      }
  return sample;
}

// The shares [styles] of [h, w, 1] at the size of the features.
std::vector<Image> CoarseShares(const RegionMatch& match, const PictureFeatures& picture) {
  const std::vector<float> shares = RegionShares(match.deciding, picture.rows);
  const size_t parts = match.deciding.size();
  std::vector<Image> coarse(match.weight_of_style.size(),
                            Image(picture.width, picture.height, 1));
  for (int64_t i = 0; i < picture.rows.rows(); ++i)
    for (size_t k = 0; k < parts; ++k)
      coarse[static_cast<size_t>(match.style_of_deciding[k])].pixels[static_cast<size_t>(i)] +=
          shares[static_cast<size_t>(i) * parts + k];
  return coarse;
}

// Three maps at a time, for the filter takes colour pictures.
void Refine(const Image& picture, std::vector<Image>* shares) {
  constexpr int kRadius = 4;
  constexpr double kEps = 0.02 * 0.02;
  const Image small = Resize(picture, (*shares)[0].width, (*shares)[0].height);
  for (size_t first = 0; first < shares->size(); first += 3) {
    const size_t count = std::min<size_t>(3, shares->size() - first);
    Image three(small.width, small.height, 3);
    for (size_t c = 0; c < count; ++c)
      for (int64_t i = 0; i < small.num_pixels(); ++i)
        three.pixels[static_cast<size_t>(3 * i) + c] =
            (*shares)[first + c].pixels[static_cast<size_t>(i)];
    const Image fine = ApplyGuided(FitGuided(small, three, kRadius, kEps), picture);
    for (size_t c = 0; c < count; ++c) {
      Image refined(picture.width, picture.height, 1);
      for (int64_t i = 0; i < picture.num_pixels(); ++i)
        refined.pixels[static_cast<size_t>(i)] =
            std::clamp(fine.pixels[static_cast<size_t>(3 * i) + c], 0.0f, 1.0f);
      (*shares)[first + c] = std::move(refined);
    }
  }
}

}  // namespace

double RegionMatch::Unsure() const {
  double weight = 0;
  for (size_t k = 0; k < scene.size(); ++k)
    if (margin_of_part[k] < kLeastMargin) weight += scene[k].weight;
  return weight;
}

double RegionMatch::Margin() const {
  double least = 1;
  for (size_t k = 0; k < scene.size(); ++k)
    if (scene[k].weight >= kMostUnsure) least = std::min(least, margin_of_part[k]);
  return least;
}

RegionMatch MatchRegions(const std::vector<PictureFeatures>& photos,
                         const std::vector<PictureFeatures>& styles) {
  REGRADE_CHECK(!photos.empty() && styles.size() >= 2);
  std::vector<RegionMixture> of_styles;
  for (const PictureFeatures& style : styles)
    of_styles.push_back(FitRegions(Sample({style}), kStyleRegions, kMatchSeed));
  RegionMatch match;
  match.scene = FitRegions(Sample(photos), kSceneRegions, kMatchSeed);
  match.weight_of_style.resize(styles.size());
  for (const RegionPart& part : match.scene) {
    constexpr double kFar = std::numeric_limits<double>::infinity();
    double nearest = kFar, next = kFar;
    size_t style = 0;
    for (size_t k = 0; k < of_styles.size(); ++k) {
      double least = kFar;
      for (const RegionPart& other : of_styles[k])
        least = std::min(least, PartDistance(part, other));
      const double distance = std::sqrt(least);
      next = std::min(next, std::max(nearest, distance));
      if (distance < nearest) {
        nearest = distance;
        style = k;
      }
    }
    match.style_of_part.push_back(static_cast<int>(style));
    match.margin_of_part.push_back(next > 0 ? 1 - nearest / next : 0);
    match.weight_of_style[style] += part.weight;
  }
  std::vector<double> largest(styles.size());
  for (size_t k = 0; k < match.scene.size(); ++k) {
    double& of_style = largest[static_cast<size_t>(match.style_of_part[k])];
    of_style = std::max(of_style, match.margin_of_part[k]);
  }
  double weight = 0;
  for (size_t k = 0; k < match.scene.size(); ++k) {
    const size_t style = static_cast<size_t>(match.style_of_part[k]);
    if (match.margin_of_part[k] < std::min(kDeciding, largest[style])) continue;
    match.deciding.push_back(match.scene[k]);
    match.style_of_deciding.push_back(match.style_of_part[k]);
    weight += match.scene[k].weight;
  }
  for (RegionPart& part : match.deciding) part.weight /= weight;
  return match;
}

std::vector<Image> RegionCoverage(const RegionMatch& match, const RegionFeatures& features,
                                  const Image& picture) {
  const Image colors = Colors(picture);
  std::vector<Image> coverage = CoarseShares(match, features.Of(colors));
  Refine(colors, &coverage);
  for (Image& region : coverage)
    if (!ShowsRegion(region)) std::ranges::fill(region.pixels, 0.0f);
  for (int64_t i = 0; i < colors.num_pixels(); ++i) {
    const size_t n = static_cast<size_t>(i);
    float sum = 0;
    for (const Image& region : coverage) sum += region.pixels[n];
    // Where only styles that are not shown had a share, the one of most of the scene has all.
    for (Image& region : coverage)
      region.pixels[n] = sum > 1e-3f ? region.pixels[n] / sum : 0.0f;
    if (!(sum > 1e-3f)) {
      const auto best = std::ranges::max_element(match.weight_of_style);
      coverage[static_cast<size_t>(best - match.weight_of_style.begin())].pixels[n] = 1;
    }
  }
  return coverage;
}

}  // namespace regrade
