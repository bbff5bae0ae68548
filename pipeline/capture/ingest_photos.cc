#include "pipeline/capture/ingest_photos.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <future>
#include <limits>
#include <map>
#include <regex>
#include <set>
#include <unordered_map>

#include "kernels/base/error.h"
#include "kernels/base/hash.h"
#include "pipeline/files/folder_listing.h"
#include "pipeline/images/image_file.h"
#include "pipeline/images/normalize_photo.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr size_t kLeastPhotos = 3;

// A photo, or why there is none.
struct Candidate {
  DecodedPhoto photo;
  Image rgb;  // over white
  uint64_t pixel_hash = 0;
  std::string problem;
};

// Of size and values as integers, so that a photo and its staged PNG agree.
template <typename Value>
uint64_t PixelHash(const Image& image) {
  Hasher hasher;
  const int shape[3] = {image.width, image.height, image.channels};
  hasher.Add(shape, sizeof shape);
  constexpr float kMax = std::numeric_limits<Value>::max();
  std::vector<Value> values(image.pixels.size());
  std::transform(image.pixels.begin(), image.pixels.end(), values.begin(), [](float v) {
    return static_cast<Value>(std::clamp(v, 0.f, 1.f) * kMax + 0.5f);
  });
  hasher.Add(values.data(), values.size() * sizeof(Value));
  return hasher.Value();
}

// Errors of a file become its problem; errors of a disk are thrown.
Candidate Decode(const ListedFile& file, const DecodeLimits& limits) {
  Candidate candidate;
  candidate.problem = file.problem;
  if (!candidate.problem.empty()) return candidate;
  try {
    candidate.photo = DecodePhoto(file.path, limits);
    candidate.pixel_hash = PixelHash<uint8_t>(candidate.photo.image);
    candidate.rgb = CompositeOnWhite(candidate.photo.image);
  } catch (const Error& error) {
    if (error.code() != ExitCode::kInput) throw;
    candidate.problem = error.what_failed();
    if (!error.hint().empty()) candidate.problem += "; " + error.hint();
  }
  return candidate;
}

Image AlphaOf(const Image& rgba) {
  Image alpha(rgba.width, rgba.height, 1);
  for (int64_t i = 0; i < rgba.num_pixels(); ++i) alpha.pixels[i] = rgba.pixels[4 * i + 3];
  return alpha;
}

bool HasTransparentPixels(const Image& rgba) {
  for (int64_t i = 0; i < rgba.num_pixels(); ++i)
    if (rgba.pixels[4 * i + 3] < 1) return true;
  return false;
}

int StagedBits(const DecodedPhoto& photo) { return photo.bits > 8 ? 16 : 8; }

// Bit depth of a PNG by its header; 0 if the file ends before.
int PngDepth(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  file.seekg(24);
  char depth = 0;
  return file.get(depth) ? depth : 0;
}

// Writes the picture unless the file already holds these pixels at this depth.
void Stage(const std::string& path, const Image& image, int bits) {
  if (fs::exists(path)) {
    try {
      if (PngDepth(path) == bits &&
          PixelHash<uint16_t>(ReadImage(path)) == PixelHash<uint16_t>(image))
        return;
    } catch (const Error&) {
      // Damaged or something else: written anew.
    }
  }
  if (bits == 16)
    WritePng16(path, image);
  else
    WritePng8(path, image);
}

void RemoveLeftovers(const std::string& folder, const std::set<std::string>& staged) {
  static const std::regex kOurs(R"(\d{5,}(\.alpha)?\.png)");
  std::vector<fs::path> leftovers;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (std::regex_match(name, kOurs) && !staged.contains(name))
      leftovers.push_back(entry.path());
  }
  for (const fs::path& path : leftovers) fs::remove(path);
}

// Reports each kind once: "12 photos: <what> (the first is a.jpg)".
class Notices {
 public:
  void Add(const std::string& what, const std::string& file) {
    auto [entry, is_new] = kinds_.try_emplace(what, Kind{file, 0});
    ++entry->second.count;
    if (is_new) order_.push_back(what);
  }
  std::vector<std::string> Texts() const {
    std::vector<std::string> texts;
    for (const std::string& what : order_) {
      const Kind& kind = kinds_.at(what);
      texts.push_back(kind.count == 1 ? kind.first + ": " + what
                                      : Concat(kind.count, " photos: ", what, " (the first is ",
                                               kind.first, ")"));
    }
    return texts;
  }

 private:
  struct Kind {
    std::string first;
    int count;
  };
  std::map<std::string, Kind> kinds_;
  std::vector<std::string> order_;
};

// "2 x not an image, 1 x empty file": why files are not used.
std::string CountReasons(const std::vector<PhotoStatus>& statuses) {
  constexpr size_t kShown = 5;
  std::map<std::string, int> counts;
  for (const PhotoStatus& photo : statuses)
    if (photo.status != PhotoState::kUsed) ++counts[photo.why];
  std::vector<std::pair<int, std::string>> sorted;
  for (const auto& [why, count] : counts) sorted.emplace_back(-count, why);
  std::ranges::sort(sorted);
  std::string text;
  for (size_t i = 0; i < std::min(sorted.size(), kShown); ++i)
    text += Concat((i ? ", " : ""), -sorted[i].first, " x ", sorted[i].second);
  if (sorted.size() > kShown)
    text += Concat(", and ", sorted.size() - kShown, " other reasons");
  return text;
}

void RequireEnough(const IngestResult& result, const std::string& folder) {
  const size_t usable = result.photos.size(), files = result.statuses.size();
  if (usable >= kLeastPhotos) return;
  std::string reasons = CountReasons(result.statuses);
  if (!reasons.empty()) reasons = ": " + reasons;
  if (usable == 0)
    throw InputError(
        files == 0
            ? "the folder is empty" +
                  (result.hidden > 0
                       ? Concat(" (except for ", result.hidden, " hidden entries)")
                       : std::string())
            : Concat(files, (files == 1 ? " file" : " files"), ", no usable photo", reasons),
        folder, "give a folder of JPEG, PNG or TIFF photos");
  throw SceneError(
      Concat(usable, (usable == 1 ? " photo" : " photos"), " of ", files,
             " files: a scene needs at least 3, better 20, from different viewpoints", reasons),
      folder);
}

std::string StagedName(size_t index, const char* suffix) {
  return Format("%05zu%s", index, suffix);
}

}  // namespace

IngestResult IngestPhotos(const std::string& folder, const std::string& staging_folder,
                          const IngestOptions& options, const ProgressFunction& progress) {
  const FolderListing listing = ListFolder(folder);
  const std::string staging = fs::absolute(staging_folder).lexically_normal().string();
  std::error_code error;
  fs::create_directories(staging, error);
  if (error) throw ResourceError("cannot create the folder: " + error.message(), staging);

  IngestResult result;
  result.hidden = listing.hidden;
  DecodeLimits limits;
  limits.max_pixels = options.max_megapixels * 1'000'000;
  limits.accept_damaged = options.accept_damaged;

  Notices notices;
  Hasher fingerprint;
  std::unordered_map<uint64_t, std::string> file_of_pixels;
  std::set<std::string> staged_names;
  const auto& files = listing.files;
  // The next file is decoded while this one is encoded. A future's destructor waits for its
  // thread, also on errors.
  const auto decode_later = [&](size_t i) {
    return i < files.size()
               ? std::async(std::launch::async, Decode, std::cref(files[i]), limits)
               : std::future<Candidate>();
  };
  std::future<Candidate> next = decode_later(0);
  for (size_t i = 0; i < files.size(); ++i) {
    const Candidate candidate = next.get();
    next = decode_later(i + 1);
    const std::string& file = files[i].name;
    ReportOrThrow(progress, i, files.size(), file);
    if (!candidate.problem.empty()) {
      result.statuses.push_back({file, PhotoState::kSkipped, candidate.problem});
      if (candidate.problem != "not an image")
        notices.Add("left out, " + candidate.problem, file);
      continue;
    }
    const auto [twin, is_new] = file_of_pixels.try_emplace(candidate.pixel_hash, file);
    if (!is_new) {
      const std::string why = "the same picture as " + twin->second;
      result.statuses.push_back({file, PhotoState::kSkipped, why});
      notices.Add("left out, " + why, file);
      continue;
    }
    const std::string name = StagedName(result.photos.size(), ".png");
    const std::string path = staging + "/" + name;
    const int bits = StagedBits(candidate.photo);
    Stage(path, candidate.rgb, bits);
    staged_names.insert(name);
    std::string notice = candidate.photo.notice;
    if (candidate.photo.image.channels == 4) {
      const std::string alpha = StagedName(result.photos.size(), ".alpha.png");
      Stage(staging + "/" + alpha, AlphaOf(candidate.photo.image), 8);
      staged_names.insert(alpha);
      if (HasTransparentPixels(candidate.photo.image))
        notice += std::string(notice.empty() ? "" : "; ") +
                  "transparent parts are composited on white";
    }
    if (!notice.empty()) notices.Add(notice, file);
    result.statuses.push_back({file, PhotoState::kUsed, notice});
    result.photos.push_back({file, name, path, candidate.rgb.width, candidate.rgb.height,
                             candidate.photo.exif_focal_px, bits});
    fingerprint.Add(file + '\n' + HashText(candidate.pixel_hash) + '\n');
  }
  Report(progress, files.size(), files.size());
  RequireEnough(result, folder);
  RemoveLeftovers(staging, staged_names);
  result.notices = notices.Texts();
  result.fingerprint = HashText(fingerprint.Value());
  return result;
}

}  // namespace regrade
