#include "pipeline/capture/ingest_summary.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "pipeline/capture/input_files.h"
#include "pipeline/images/normalize_photo.h"
#include "reconstruct/colmap/colmap_strategies.h"

namespace regrade {
namespace {

constexpr size_t kLeastPhotos = 3;
constexpr double kHardlyMoves = 3;  // steps of a whole film

std::string Several(const std::string& first, int count, const std::string& what) {
  return count == 1 ? first + ": " + what
                    : Concat(count, " photos: ", what, " (the first is ", first, ")");
}

// "24 photos (20 of 4032 x 3024, 4 of 3024 x 4032)": the groups that become one camera each.
std::string PhotosText(const std::vector<StagedPhoto>& photos) {
  std::map<std::string, int> sizes;
  int count = 0;
  for (const CameraGroup& group : GroupByCamera(photos)) {
    const int members = static_cast<int>(group.names.size());
    std::string size = Concat(group.width, " x ", group.height);
    if (group.focal_px > 0) size += Format(" at focal length %.0f px", group.focal_px);
    sizes[size] += members;
    count += members;
  }
  return Concat(count, count == 1 ? " photo" : " photos", " (",
                sizes.size() == 1 ? sizes.begin()->first : CountsText(sizes, " of "), ")");
}

}  // namespace

void IngestNotices::Count(std::map<std::string, Kind>* kinds, const std::string& what,
                          const std::string& file, double clipped) {
  Kind& kind = (*kinds)[what];
  if (kind.count++ == 0) kind.first = file;
  kind.clipped += clipped;
  kind.most_clipped = std::max(kind.most_clipped, clipped);
}

void IngestNotices::Add(const std::string& what, const std::string& file) {
  if (!kinds_.contains(what)) order_.push_back(what);
  Count(&kinds_, what, file, 0);
}

void IngestNotices::AddColors(const std::string& colors, double clipped,
                              const std::string& file) {
  if (!colors.empty() || clipped > 0) Count(&colors_, colors, file, clipped);
}

void IngestNotices::AddClip(const ClipSurvey& clip, size_t frames) {
  std::string text = Concat(clip.file, ": ", frames, " of ", clip.frames.size(), " frames") +
                     Format(" (%.1f s) are taken, by motion and sharpness",
                            clip.frames.empty() ? 0 : clip.frames.back().seconds);
  if (clip.Travel() < kHardlyMoves) text += "; the camera hardly moves in it";
  if (clip.damaged > 0) text += Concat("; ", clip.damaged, " could not be decoded");
  if (clip.interlaced > 0)
    text +=
        "; it is interlaced: of each frame the rows of the first moment are kept, and the "
        "others are interpolated";
  if (!clip.info.colors.empty()) text += "; " + ColorNotice(clip.info.colors, 0);
  clips_.push_back(text);
}

std::vector<std::string> IngestNotices::Texts() const {
  std::vector<std::string> texts = clips_;
  for (const auto& [colors, kind] : colors_) {
    std::string what = ColorNotice(colors, kind.clipped / kind.count);
    if (kind.count > 1 && kind.most_clipped > 0)
      what += Format(", at most %.3g %% of one photo's", 100 * kind.most_clipped);
    texts.push_back(Several(kind.first, kind.count, what));
  }
  for (const std::string& what : order_) {
    const Kind& kind = kinds_.at(what);
    texts.push_back(Several(kind.first, kind.count, what));
  }
  return texts;
}

std::string TakenAndLeft(const std::vector<StagedPhoto>& photos,
                         const std::vector<ClipSurvey>& clips,
                         const std::map<std::string, int>& left) {
  std::vector<StagedPhoto> stills;
  for (const StagedPhoto& photo : photos)
    if (photo.clip < 0) stills.push_back(photo);
  if (clips.empty() && left.empty() && GroupByCamera(stills).size() <= 1) return "";
  std::string taken = stills.empty() ? "" : PhotosText(stills);
  for (size_t i = 0; i < clips.size(); ++i) {
    const auto frames = std::ranges::count(photos, static_cast<int>(i), &StagedPhoto::clip);
    if (frames > 0)
      taken += Concat(taken.empty() ? "" : ", ", frames, " frames of ", clips[i].file);
  }
  std::string text = "taken: " + (taken.empty() ? "nothing" : taken);
  if (!left.empty()) text += "; left: " + CountsText(left, " x ");
  return text;
}

void RequireEnoughPhotos(size_t usable, const std::vector<PhotoStatus>& statuses, int hidden,
                         const std::string& where) {
  if (usable >= kLeastPhotos) return;
  const size_t files = statuses.size();
  std::map<std::string, int> counts;
  for (const PhotoStatus& photo : statuses)
    if (photo.status != PhotoState::kUsed) ++counts[photo.why];
  std::string reasons = CountsText(counts, " x ");
  if (!reasons.empty()) reasons = ": " + reasons;
  if (usable == 0)
    throw InputError(
        files == 0
            ? "the folder is empty" + (hidden > 0
                                           ? Concat(" (except for ", hidden, " hidden entries)")
                                           : std::string())
            : Concat(files, (files == 1 ? " file" : " files"), ", no usable photo", reasons),
        where, "give a folder of JPEG, PNG, TIFF, HEIC or raw photos, or a film");
  throw SceneError(
      Concat(usable, (usable == 1 ? " photo" : " photos"), " of ", files,
             " files: a scene needs at least 3, better 20, from different viewpoints", reasons),
      where);
}

}  // namespace regrade
