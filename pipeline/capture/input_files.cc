#include "pipeline/capture/input_files.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>

#include "kernels/base/error.h"
#include "kernels/base/natural_order.h"
#include "pipeline/files/text.h"
#include "pipeline/images/image_format.h"
#include "pipeline/images/video_reader.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr size_t kSniffedBytes = 4096;

bool IsIn(const fs::path& path, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first ==
         folder.end();
}

// Folder and name without the extension: the same for the parts of one shot.
std::string ShotOf(const std::string& name) {
  return fs::path(name).replace_extension().string();
}

const ImageFormat* FormatOf(const ListedFile& file) {
  std::string begin(kSniffedBytes, '\0');
  std::ifstream stream(file.path, std::ios::binary);
  stream.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  begin.resize(std::max<std::streamsize>(0, stream.gcount()));
  return SniffImageFormat(begin, file.path);
}

void Leave(InputFile* input, const std::string& as, const std::string& why) {
  input->kind = InputKind::kLeft;
  input->left_as = as;
  input->why = why;
}

InputFiles OneFilm(const fs::path& path) {
  const ListedFile file = {path.filename().string(), path.string(), ""};
  const ImageFormat* format = FormatOf(file);
  if (format == nullptr || !IsVideo(*format)) {
    std::error_code none;
    throw InputError(fs::file_size(path, none) == 0 ? "empty file" : "is a file, not a folder",
                     path.string(), "name a folder of photos, or a film");
  }
  InputFiles inputs;
  inputs.files.push_back({file, InputKind::kClip, "", ""});
  return inputs;
}

}  // namespace

double SecondsOfFilm(const std::string& path) {
  try {
    return VideoReader(path).info().seconds;
  } catch (const Error&) {
    return 0;
  }
}

int InputFiles::Count(InputKind kind) const {
  return static_cast<int>(std::ranges::count(files, kind, &InputFile::kind));
}

InputFiles ListInputs(const std::string& path, bool take_clips,
                      const std::set<std::string>& only,
                      const std::vector<std::string>& not_photos) {
  std::error_code none;
  if (fs::is_regular_file(path, none)) return OneFilm(path);
  FolderListing listing = only.empty() ? ListFolder(path) : ListNames(path, only);
  const fs::path root = fs::weakly_canonical(path, none);
  for (const std::string& folder : not_photos)
    if (only.empty() && !IsIn(root, folder))
      std::erase_if(listing.files,
                    [&](const ListedFile& file) { return IsIn(root / file.name, folder); });
  InputFiles inputs;
  inputs.hidden = listing.hidden;
  inputs.runs = listing.runs;
  std::map<std::string, std::string> picture_of_shot;
  std::set<size_t> raw;
  for (ListedFile& file : listing.files) {
    inputs.files.push_back({std::move(file), InputKind::kPhoto, "", ""});
    InputFile& input = inputs.files.back();
    const std::string name = input.file.name, extension = LowerExtension(name);
    if (!input.file.problem.empty()) continue;
    const ImageFormat* format = FormatOf(input.file);
    if (format == nullptr) continue;
    if (extension == ".thm")
      Leave(&input, "camera's thumbnail", "a thumbnail that the camera made");
    else if (IsVideo(*format) && (extension == ".lrv" || extension == ".lrf"))
      Leave(&input, "camera's small film", "a small copy of a film that the camera made");
    else if (IsVideo(*format))
      input.kind = InputKind::kClip;
    else if (IsCameraRaw(*format))
      raw.insert(inputs.files.size() - 1);
    else
      picture_of_shot.try_emplace(ShotOf(name), name);
  }
  for (size_t i = 0; i < inputs.files.size(); ++i) {
    InputFile& input = inputs.files[i];
    const auto picture = picture_of_shot.find(ShotOf(input.file.name));
    const bool paired = picture != picture_of_shot.end();
    if (input.kind == InputKind::kClip) {
      if (!take_clips)
        Leave(&input, "film beside given poses", "a film has no given poses");
      else if (paired)
        if (const double s = SecondsOfFilm(input.file.path); s > 0 && s <= kLongestLiveClip)
          Leave(&input, "live-photo clip", "the live-photo clip of " + picture->second);
    } else if (paired && raw.contains(i)) {
      Leave(&input, "raw file beside its picture", "the raw file of " + picture->second);
    }
  }
  return inputs;
}

std::string CountsText(const std::map<std::string, int>& counts, const std::string& between) {
  constexpr size_t kShown = 5;
  std::vector<std::pair<int, std::string>> sorted;
  for (const auto& [what, count] : counts) sorted.emplace_back(-count, what);
  std::ranges::sort(sorted);
  std::string text;
  for (size_t i = 0; i < std::min(sorted.size(), kShown); ++i)
    text += Concat((i ? ", " : ""), -sorted[i].first, between, sorted[i].second);
  if (sorted.size() > kShown) text += Concat(", and ", sorted.size() - kShown, " others");
  return text;
}

}  // namespace regrade
