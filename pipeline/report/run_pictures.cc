#include "pipeline/report/run_pictures.h"

#include <algorithm>
#include <exception>
#include <filesystem>
#include <map>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"
#include "pipeline/files/json_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/report/sequence_names.h"

namespace regrade {
namespace {

constexpr int kJpegQuality = 85, kThumbnailQuality = 70;
constexpr int kThumbnailSide = 112;  // pixels, longer side

ReportPicture Encoded(const Image& image, int quality) {
  return {EncodeJpeg(image, quality), image.width, image.height};
}

std::optional<ReportPicture> ThumbnailAt(const std::string& path) {
  const std::optional<Image> image = path.empty() ? std::nullopt : ImageAt(path);
  if (!image) return std::nullopt;
  const double scale = std::min(
      1.0, static_cast<double>(kThumbnailSide) / std::max(image->width, image->height));
  const auto side = [scale](int pixels) {
    return std::max(1, static_cast<int>(pixels * scale + 0.5));
  };
  return Encoded(Resize(*image, side(image->width), side(image->height)), kThumbnailQuality);
}

// Paths of the staged photos, by the user's file names.
std::map<std::string, std::string> StagedPictures(const Workspace& workspace) {
  std::map<std::string, std::string> paths;
  const JsonValue index = ReadJsonFile(workspace.Path("poses/photos.json"));
  for (const JsonValue& photo : index.At("photos").AsArray())
    paths[photo.At("file").AsString()] =
        workspace.Path("poses/photos/" + photo.At("name").AsString());
  return paths;
}

}  // namespace

std::optional<Image> ImageAt(const std::string& path) {
  if (!std::filesystem::exists(path)) return std::nullopt;
  try {
    Image image = ReadImage(path);
    if (image.channels == 3) return image;
  } catch (const std::exception&) {  // the page does without; none leaves a parallel loop
  }
  return std::nullopt;
}

std::optional<ReportPicture> PictureAt(const std::string& path) {
  const std::optional<Image> image = ImageAt(path);
  if (!image) return std::nullopt;
  return Encoded(*image, kJpegQuality);
}

std::vector<ReportHeatMap> HeatMapPictures(const Workspace& workspace,
                                           const EvaluationMetrics& metrics) {
  std::vector<ReportHeatMap> maps;
  for (const ConsistencyMetrics& row : metrics.consistency) {
    if (row.heat_map.empty()) continue;
    const auto picture = PictureAt(workspace.Path(row.heat_map));
    if (!picture) continue;
    const int from = row.heat_map_from.value_or(0);
    maps.push_back({SequenceLabel(row.sequence) + ", frames " + std::to_string(from) + " and " +
                        std::to_string(from + row.gap),
                    *picture});
  }
  return maps;
}

std::vector<std::optional<ReportPicture>> Thumbnails(const Workspace& workspace,
                                                     const Capture& capture) {
  const std::map<std::string, std::string> staged = StagedPictures(workspace);
  const int count = static_cast<int>(capture.statuses.size());
  std::vector<std::string> wanted(capture.statuses.size());
  int taken = 0;
  for (int i = 0; i < count; ++i) {
    const PhotoStatus& photo = capture.statuses[static_cast<size_t>(i)];
    const auto path = staged.find(photo.file);
    if (path == staged.end()) continue;
    // Evenly spaced.
    const bool due = count <= kMostThumbnails ||
                     taken < (i + 1) * static_cast<int64_t>(kMostThumbnails) / count;
    if (photo.status == PhotoState::kUsed && !due) continue;
    taken += photo.status == PhotoState::kUsed;
    wanted[static_cast<size_t>(i)] = path->second;
  }
  // Decoding photos takes most of the time.
  std::vector<std::optional<ReportPicture>> thumbnails(wanted.size());
#pragma omp parallel for schedule(dynamic)
  for (int i = 0; i < count; ++i)
    thumbnails[static_cast<size_t>(i)] = ThumbnailAt(wanted[static_cast<size_t>(i)]);
  return thumbnails;
}

}  // namespace regrade
