#include "pipeline/commands/paired_benchmark.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/image/color_statistics.h"
#include "pipeline/files/folder_listing.h"
#include "pipeline/images/image_file.h"
#include "pipeline/stages/control_sequences.h"
#include "stylize/image/monge_kantorovich.h"

namespace regrade {
namespace {

// Paths by the name without its ending, in natural order of names.
std::vector<std::pair<std::string, std::string>> PicturesOf(const std::string& folder) {
  std::vector<std::pair<std::string, std::string>> pictures;
  for (const ListedFile& file : ListFolder(folder).files) {
    if (!file.problem.empty())
      throw InputError("a picture cannot be opened: " + file.problem, folder + "/" + file.name,
                       "keep only pictures in this folder");
    pictures.emplace_back(std::filesystem::path(file.name).replace_extension().string(),
                          file.path);
  }
  if (pictures.empty()) throw InputError("there are no pictures here", folder);
  return pictures;
}

class NamedPictures {
 public:
  explicit NamedPictures(const std::string& folder) : folder_(folder) {
    for (const auto& [name, path] : PicturesOf(folder)) paths_[name] = path;
  }
  Image Read(const std::string& name) const {
    const auto found = paths_.find(name);
    if (found == paths_.end())
      throw InputError("there is no picture " + name, folder_,
                       "every picture of paired_gt needs its own of the same name");
    return ReadStylePicture(found->second, nullptr);  // three channels
  }

 private:
  std::string folder_;
  std::map<std::string, std::string> paths_;
};

Image UnderLinearMap(const Image& content, const Image& style) {
  const ColorMap map = ComputeMkl(MeasureColor(content), MeasureColor(style)).map;
  Image mapped = content;
  for (int64_t p = 0; p < content.num_pixels(); ++p) {
    float* c = &mapped.pixels[static_cast<size_t>(3 * p)];
    const Vec3d value = map(Vec3d{c[0], c[1], c[2]});
    for (int k = 0; k < 3; ++k) c[k] = static_cast<float>(std::clamp(value[k], 0.0, 1.0));
  }
  return mapped;
}

JsonValue NumberOrNull(const std::optional<double>& value) {
  return value ? JsonValue(*value) : JsonValue();  // infinite ones are written as null
}

}  // namespace

std::vector<PairedRow> MeasurePairedFolder(
    const PairedFolder& benchmark,
    const std::function<double(const Image&, const Image&)>& perceptual,
    const ProgressFunction& progress) {
  const auto in = [&](const char* name) { return benchmark.folder + "/" + name; };
  const auto truths = PicturesOf(in("paired_gt"));
  const NamedPictures results(benchmark.results), contents(in("content_709"));
  const std::optional<NamedPictures> styles =
      benchmark.controls ? std::optional<NamedPictures>(in("paired_style")) : std::nullopt;
  std::vector<PairedRow> rows{{"result", {}}, {"content", {}}};
  if (styles) rows.push_back({kLinearMapControl, {}});
  for (size_t i = 0; i < truths.size(); ++i) {
    const auto& [name, path] = truths[i];
    const Image truth = ReadStylePicture(path, nullptr);
    const Image content = contents.Read(name);
    std::vector<Image> pictures{results.Read(name), content};
    if (styles) pictures.push_back(UnderLinearMap(content, styles->Read(name)));
    for (size_t row = 0; row < rows.size(); ++row) {
      const Image& picture = pictures[row];
      if (!picture.SameSize(truth))
        throw InputError(Concat("picture ", name, " of ", rows[row].name, " is ", picture.width,
                                " x ", picture.height, " px, its ground truth ", truth.width,
                                " x ", truth.height, " px"),
                         row == 0 ? benchmark.results : benchmark.folder,
                         "keep the content's size");
      rows[row].pictures.push_back(MeasurePair(name, picture, truth, perceptual));
    }
    ReportOrThrow(progress, static_cast<int64_t>(i) + 1, std::ssize(truths));
  }
  return rows;
}

JsonValue PairedJson(const std::vector<PairedRow>& rows) {
  constexpr std::pair<const char*, std::optional<double> PairedQuality::*> kMetrics[] = {
      {"psnr_db", &PairedQuality::psnr_db},
      {"ssim", &PairedQuality::ssim},
      {"histogram_correlation", &PairedQuality::histogram_correlation},
      {"lpips", &PairedQuality::lpips}};
  JsonValue means = JsonValue::Array(), pictures = JsonValue::Array();
  for (const PairedRow& row : rows) {
    JsonValue mean = JsonValue::Object{{"pictures_of", row.name},
                                       {"number", static_cast<int64_t>(row.pictures.size())}};
    for (const auto& [key, metric] : kMetrics) mean[key] = NumberOrNull(row.Mean(metric));
    means.Append(std::move(mean));
    for (const PairedQuality& picture : row.pictures) {
      JsonValue each = JsonValue::Object{{"pictures_of", row.name}, {"name", picture.name}};
      for (const auto& [key, metric] : kMetrics) each[key] = NumberOrNull(picture.*metric);
      pictures.Append(std::move(each));
    }
  }
  return JsonValue::Object{{"paired", std::move(means)}, {"pictures", std::move(pictures)}};
}

}  // namespace regrade
