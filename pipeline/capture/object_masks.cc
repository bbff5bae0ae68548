#include "pipeline/capture/object_masks.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"
#include "pipeline/capture/mask_picture.h"
#include "pipeline/capture/photo_names.h"
#include "pipeline/images/image_file.h"
#include "pipeline/workspace/stage_record.h"

namespace regrade {
namespace {

// JPEG's ringing around a plain colour; labels must differ by more than twice that.
constexpr float kSameLabel = 24.0f / 255;

bool Same(const Vec3f& a, const Vec3f& b) {
  return std::abs(a.x - b.x) <= kSameLabel && std::abs(a.y - b.y) <= kSameLabel &&
         std::abs(a.z - b.z) <= kSameLabel;
}

// Plain colours except black, each on at least a thousandth of the picture: mixtures along
// edges are fewer.
std::vector<Vec3f> LabelsOf(const std::string& path) {
  const Image mask = ReadGivenImage(path);
  std::vector<Vec3f> labels;
  std::vector<int64_t> counts;
  for (int64_t i = 0; i < mask.num_pixels(); ++i) {
    const Vec3f color = MaskColor(mask, i);
    if (Same(color, {0, 0, 0})) continue;
    size_t k = 0;
    while (k < labels.size() && !Same(labels[k], color)) ++k;
    if (k == labels.size()) {
      labels.push_back(color);
      counts.push_back(0);
      if (labels.size() > 4096) break;  // a photograph
    }
    ++counts[k];
  }
  std::vector<Vec3f> kept;
  for (size_t k = 0; k < labels.size(); ++k)
    if (counts[k] * 1000 >= mask.num_pixels()) kept.push_back(labels[k]);
  if (kept.empty())
    throw InputError("has no region: it is entirely black", path,
                     "paint each region of the style in one plain colour");
  if (kept.size() > ObjectMasks::kMostRegions)
    throw InputError(Concat("has ", kept.size(), " colours, at most ",
                            ObjectMasks::kMostRegions, " are regions"),
                     path, "paint each region in one plain colour, and save it as PNG");
  return kept;
}

}  // namespace

ObjectMasks::ObjectMasks(const MaskOptions& options, const std::vector<std::string>& photos,
                         std::optional<WorkingViews> views)
    : views_(std::move(views)),
      style_mask_(options.style_mask),
      paths_(PicturesByPhotoName(options.masks, photos, "mask")) {
  if (!style_mask_.empty()) labels_ = LabelsOf(style_mask_);
}

int ObjectMasks::num_known() const {
  return static_cast<int>(
      std::ranges::count_if(paths_, [](const std::string& path) { return !path.empty(); }));
}

std::vector<Image> ObjectMasks::Regions(const std::string& path, int width, int height) const {
  const Image mask = labels_.empty() ? ReadMask(path) : ReadGivenImage(path);
  CheckAspect(mask, width, height, path, ExitCode::kInput);
  std::vector<Image> regions;
  for (int k = 0; k < num_regions(); ++k) {
    Image region = mask;
    if (!labels_.empty()) {
      region = Image(mask.width, mask.height, 1);
      for (int64_t i = 0; i < mask.num_pixels(); ++i)
        region.pixels[i] = Same(MaskColor(mask, i), labels_[k]) ? 1.0f : 0.0f;
    }
    regions.push_back(region.width == width && region.height == height
                          ? std::move(region)
                          : Resize(region, width, height));
  }
  // Labels closer than their tolerance would count a pixel twice.
  for (int64_t i = 0; i < regions[0].num_pixels(); ++i) {
    float sum = 0;
    for (const Image& region : regions) sum += region.pixels[i];
    if (sum > 1)
      for (Image& region : regions) region.pixels[i] /= sum;
  }
  return regions;
}

std::vector<Image> ObjectMasks::Coverage(int view, int width, int height) const {
  REGRADE_CHECK(Knows(view));
  std::vector<Image> regions = Regions(paths_[view], width, height);
  if (views_)
    for (Image& region : regions) region = views_->AsSeen(view, std::move(region));
  return regions;
}

Image ObjectMasks::StyleRegion(int region, int width, int height) const {
  if (labels_.empty()) return {};
  return Regions(style_mask_, width, height)[region];
}

JsonValue MaskFiles(const MaskOptions& options) {
  JsonValue hashes = HashFolder(options.masks);
  if (!options.style_mask.empty()) hashes["style mask"] = HashFile(options.style_mask);
  return hashes;
}

void ProbeMasks(MaskOptions* options) {
  namespace fs = std::filesystem;
  for (const auto& [path, flag] :
       {std::pair{&options->masks, "--masks"}, {&options->style_mask, "--style-mask"}}) {
    if (path->empty()) continue;
    std::error_code error;
    if (!fs::exists(*path, error))
      throw InputError("there is no such file or folder", *path,
                       std::string("correct ") + flag);
    *path = fs::absolute(*path, error).lexically_normal().string();
  }
}

}  // namespace regrade
