#include "pipeline/capture/ingest_photos.h"

#include <algorithm>
#include <filesystem>
#include <future>
#include <map>
#include <memory>
#include <set>
#include <unordered_map>

#include "kernels/base/error.h"
#include "kernels/base/hash.h"
#include "kernels/base/quantile.h"
#include "pipeline/capture/clip_frames.h"
#include "pipeline/capture/ingest_summary.h"
#include "pipeline/capture/input_files.h"
#include "pipeline/capture/repeated_shots.h"
#include "pipeline/capture/staged_files.h"
#include "pipeline/files/text.h"
#include "pipeline/images/image_file.h"
#include "pipeline/images/normalize_photo.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr char kNotAnImage[] = "not an image";
// A photo whose longer side is below this fraction of the larger photos' is a thumbnail.
constexpr double kThumbnail = 0.25;
constexpr double kLargerPhotos = 0.75;  // quantile of the longer sides
constexpr int kUsualFrames = 80;        // of films, before they are surveyed
// Of the time that a film takes, while it is surveyed and while its frames are staged.
constexpr double kSurveyWeight = 0.6;

// A photo, or why there is none.
struct Candidate {
  DecodedPhoto photo;
  Image rgb;   // over white
  Image look;  // see ShotLook
  uint64_t pixel_hash = 0;
  std::string problem;

  void Complete() {
    pixel_hash = PixelHash8(photo.image);
    rgb = CompositeOnWhite(photo.image);
    look = LookOf(rgb);
  }
};

// A file, or a frame of a film.
struct Item {
  std::string name;  // the user's
  const InputFile* input = nullptr;
  int clip = -1;
  size_t frame = 0;  // of the decoded ones
};

// Reads picked frames in their order.
class ClipFrames {
 public:
  ClipFrames(const std::vector<ClipSurvey>& clips, const VideoLimits& limits)
      : clips_(clips), limits_(limits) {}

  Image Read(int clip, size_t frame) {
    if (clip != clip_) {
      reader_ = std::make_unique<VideoReader>(clips_[static_cast<size_t>(clip)].path, limits_);
      clip_ = clip;
      decoded_ = 0;
    }
    for (; decoded_ <= frame; ++decoded_)
      if (!reader_->Next())
        throw InputError("the film has become shorter", clips_[static_cast<size_t>(clip)].path);
    return reader_->Picture();
  }

 private:
  const std::vector<ClipSurvey>& clips_;
  const VideoLimits limits_;
  std::unique_ptr<VideoReader> reader_;
  int clip_ = -1;
  size_t decoded_ = 0;  // frames of this film
};

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

class Ingest {
 public:
  Ingest(const std::string& source, const std::string& staging_folder,
         const IngestOptions& options)
      : source_(source),
        staging_(fs::absolute(staging_folder).lexically_normal().string()),
        options_(options),
        inputs_(ListInputs(source, options.take_clips, options.only, options.not_photos)) {
    limits_.max_pixels = options.max_megapixels * 1'000'000;
    limits_.accept_damaged = options.accept_damaged;
    video_limits_.max_pixels = limits_.max_pixels;
    std::error_code error;
    fs::create_directories(staging_, error);
    if (error) throw ResourceError("cannot create the folder: " + error.message(), staging_);
  }

  IngestResult Run(const ProgressFunction& progress) {
    const int clips = inputs_.Count(InputKind::kClip);
    const double photos = static_cast<double>(inputs_.files.size()) - clips;
    // A film costs about as much as so many photos.
    const double films = static_cast<double>(clips) * kMostFrames;
    ProgressParts parts(progress, photos + films);
    if (clips > 0) SurveyClips(parts.Next(kSurveyWeight * films));
    StageAll(clips > 0 ? parts.Next(photos + (1 - kSurveyWeight) * films) : progress);
    Drop(Thumbnails());
    if (options_.one_a_shot) Drop(Repeated());
    Finish();
    return std::move(result_);
  }

 private:
  void SurveyClips(const ProgressFunction& progress) {
    ProgressParts parts(progress, inputs_.Count(InputKind::kClip));
    for (const InputFile& input : inputs_.files)
      if (input.kind == InputKind::kClip)
        clips_.push_back(
            SurveyClip(input.file.name, input.file.path, video_limits_, parts.Next(1)));
    picked_ = PickFrames(clips_, options_.video_frames);
    for (size_t i = 0; i < clips_.size(); ++i)
      if (clips_[i].problem.empty()) notices_.AddClip(clips_[i], picked_[i].size());
  }

  // Files and picked frames, in natural order of the files' names.
  std::vector<Item> Items() const {
    std::vector<Item> items;
    int clip = -1;
    for (const InputFile& input : inputs_.files) {
      if (input.kind == InputKind::kClip) ++clip;
      if (input.kind != InputKind::kClip ||
          !clips_[static_cast<size_t>(clip)].problem.empty()) {
        items.push_back({input.file.name, &input, -1, 0});
        continue;
      }
      const ClipSurvey& survey = clips_[static_cast<size_t>(clip)];
      for (const size_t frame : picked_[static_cast<size_t>(clip)])
        items.push_back(
            {FrameName(input.file.name, survey.frames[frame].seconds), &input, clip, frame});
    }
    return items;
  }

  // Errors of a file become its problem; errors of a disk are thrown.
  Candidate Decode(const Item& item, ClipFrames* frames) const {
    Candidate candidate;
    candidate.problem = item.input->file.problem;
    if (item.clip < 0 && item.input->kind == InputKind::kClip)
      for (const ClipSurvey& clip : clips_)
        if (clip.file == item.name) candidate.problem = clip.problem;
    if (item.input->kind == InputKind::kLeft) candidate.problem = item.input->why;
    if (!candidate.problem.empty()) return candidate;
    try {
      if (item.clip >= 0)
        candidate.photo.image = frames->Read(item.clip, item.frame);
      else
        candidate.photo = DecodePhoto(item.input->file.path, limits_);
      candidate.Complete();
    } catch (const Error& error) {
      if (error.code() != ExitCode::kInput) throw;
      candidate.problem = error.what_failed();
      if (!error.hint().empty() && candidate.problem != kNotAnImage)
        candidate.problem += "; " + error.hint();
    }
    return candidate;
  }

  void StageAll(const ProgressFunction& progress) {
    const std::vector<Item> items = Items();
    ClipFrames frames(clips_, video_limits_);
    // The next item is decoded while this one is encoded. A future's destructor waits for its
    // thread, also on errors.
    const auto decode_later = [&](size_t i) {
      return i < items.size()
                 ? std::async(std::launch::async,
                              [this, &items, &frames, i] { return Decode(items[i], &frames); })
                 : std::future<Candidate>();
    };
    std::future<Candidate> next = decode_later(0);
    for (size_t i = 0; i < items.size(); ++i) {
      const Candidate candidate = next.get();
      next = decode_later(i + 1);
      ReportOrThrow(progress, i, items.size(), items[i].name);
      Take(items[i], candidate);
    }
    Report(progress, items.size(), items.size());
  }

  void Take(const Item& item, const Candidate& candidate) {
    if (item.input->kind == InputKind::kLeft)
      return LeaveOut(item.name, candidate.problem, item.input->left_as);
    if (candidate.problem == kNotAnImage)
      return LeaveOut(item.name, candidate.problem,
                      "no picture" + fs::path(item.name).extension().string());
    if (!candidate.problem.empty()) {
      notices_.Add("left out, " + candidate.problem, item.name);
      return LeaveOut(item.name, candidate.problem, "unusable file");
    }
    const auto [twin, is_new] = file_of_pixels_.try_emplace(candidate.pixel_hash, item.name);
    if (!is_new) {
      const std::string why = "the same picture as " + twin->second;
      notices_.Add("left out, " + why, item.name);
      return LeaveOut(item.name, why, "repeated picture");
    }
    Stage(item, candidate);
  }

  void LeaveOut(const std::string& name, const std::string& why, const std::string& as) {
    result_.statuses.push_back({name, PhotoState::kSkipped, why});
    ++left_[as];
  }

  void Stage(const Item& item, const Candidate& candidate) {
    const size_t index = result_.photos.size();
    const std::string name = StagedName(index, ".png"), path = staging_ + "/" + name;
    const int bits = candidate.photo.bits > 8 ? 16 : 8;
    StagePicture(path, candidate.rgb, bits);
    std::string notice = candidate.photo.notice;
    has_alpha_.push_back(candidate.photo.image.channels == 4);
    if (has_alpha_.back()) {
      StagePicture(staging_ + "/" + StagedName(index, ".alpha.png"),
                   AlphaOf(candidate.photo.image), 8);
      if (HasTransparentPixels(candidate.photo.image))
        notice += std::string(notice.empty() ? "" : "; ") +
                  "transparent parts are composited on white";
    }
    if (!notice.empty()) notices_.Add(notice, item.name);
    notices_.AddColors(candidate.photo.colors, candidate.photo.clipped, item.name);
    result_.statuses.push_back({item.name, PhotoState::kUsed, notice});
    result_.photos.push_back({item.name, name, path, candidate.rgb.width, candidate.rgb.height,
                              candidate.photo.exif_focal_px, bits, item.clip,
                              candidate.photo.orientation, candidate.photo.gps});
    looks_.push_back({item.name, candidate.rgb.width, candidate.rgb.height,
                      candidate.photo.bits, candidate.photo.taken, candidate.photo.light,
                      candidate.look});
    hashes_.push_back(candidate.pixel_hash);
  }

  // Only all sizes together show which photos are thumbnails of others.
  std::vector<LeftShot> Thumbnails() const {
    std::vector<int> sides;
    for (const StagedPhoto& photo : result_.photos)
      if (photo.clip < 0) sides.push_back(std::max(photo.width, photo.height));
    const double limit = kThumbnail * Quantile(sides, kLargerPhotos);
    std::vector<LeftShot> left(result_.photos.size());
    for (size_t i = 0; i < left.size(); ++i) {
      const StagedPhoto& photo = result_.photos[i];
      if (photo.clip < 0 && std::max(photo.width, photo.height) < limit)
        left[i] = {"thumbnail", Concat("a thumbnail: ", photo.width, " x ", photo.height)};
    }
    return left;
  }

  std::vector<LeftShot> Repeated() const {
    std::vector<ShotLook> stills;
    std::vector<size_t> index;
    for (size_t i = 0; i < result_.photos.size(); ++i)
      if (result_.photos[i].clip < 0) {
        stills.push_back(looks_[i]);
        index.push_back(i);
      }
    std::vector<LeftShot> left(result_.photos.size());
    const std::vector<LeftShot> of_stills = RepeatedShots(stills);
    for (size_t s = 0; s < index.size(); ++s) left[index[s]] = of_stills[s];
    return left;
  }

  void Drop(const std::vector<LeftShot>& left) {
    const std::vector<StagedPhoto> all = std::move(result_.photos);
    result_.photos.clear();
    for (size_t i = 0; i < all.size(); ++i) {
      StagedPhoto photo = all[i];
      const size_t index = result_.photos.size();
      if (!left[i].as.empty()) {
        for (PhotoStatus& status : result_.statuses)
          if (status.file == photo.file)
            status = {photo.file, PhotoState::kSkipped, left[i].why};
        ++left_[left[i].as];
        continue;
      }
      if (index != i) {
        RenumberStaged(staging_, i, index);
        photo.name = StagedName(index, ".png");
        photo.path = staging_ + "/" + photo.name;
        hashes_[index] = hashes_[i];
        has_alpha_[index] = has_alpha_[i];
        looks_[index] = looks_[i];
      }
      result_.photos.push_back(photo);
    }
  }

  void Finish() {
    RequireEnoughPhotos(result_.photos.size(), result_.statuses, inputs_.hidden, source_);
    Hasher fingerprint;
    std::set<std::string> staged;
    for (size_t i = 0; i < result_.photos.size(); ++i) {
      fingerprint.Add(result_.photos[i].file + '\n' + HashText(hashes_[i]) + '\n');
      staged.insert(result_.photos[i].name);
      if (has_alpha_[i]) staged.insert(StagedName(i, ".alpha.png"));
    }
    RemoveLeftovers(staging_, staged);
    result_.hidden = inputs_.hidden;
    result_.notices = notices_.Texts();
    for (const std::string& run : inputs_.runs)
      result_.notices.push_back("left out, the results of regrade in " + run);
    result_.summary = TakenAndLeft(result_.photos, clips_, left_);
    result_.fingerprint = HashText(fingerprint.Value());
  }

  const std::string source_, staging_;
  const IngestOptions& options_;
  const InputFiles inputs_;
  DecodeLimits limits_;
  VideoLimits video_limits_;
  std::vector<ClipSurvey> clips_;
  std::vector<std::vector<size_t>> picked_;  // frames of each
  IngestResult result_;
  std::vector<uint64_t> hashes_;  // of the photos' pixels
  std::vector<bool> has_alpha_;
  std::vector<ShotLook> looks_;
  std::unordered_map<uint64_t, std::string> file_of_pixels_;
  std::map<std::string, int> left_;  // by what they are
  IngestNotices notices_;
};

}  // namespace

IngestResult IngestPhotos(const std::string& source, const std::string& staging_folder,
                          const IngestOptions& options, const ProgressFunction& progress) {
  return Ingest(source, staging_folder, options).Run(progress);
}

InputFiles InputsOf(const CaptureSource& source) {
  return ListInputs(source.photos, source.kind == CaptureKind::kPhotos, source.only,
                    source.not_photos);
}

int64_t ExpectedPhotos(const InputFiles& inputs, const IngestOptions& options) {
  const int frames = options.video_frames > 0 ? options.video_frames : kUsualFrames;
  return inputs.Count(InputKind::kPhoto) + (inputs.Count(InputKind::kClip) > 0 ? frames : 0);
}

std::string PlannedInputs(const InputFiles& inputs, const IngestOptions& options) {
  const int clips = inputs.Count(InputKind::kClip);
  const std::string files = Counted(std::ssize(inputs.files) - clips, "file");
  if (clips == 0) return files;
  double seconds = 0;
  for (const InputFile& input : inputs.files)
    if (input.kind == InputKind::kClip) seconds += SecondsOfFilm(input.file.path);
  return (inputs.files.size() > static_cast<size_t>(clips) ? files + " and " : "") +
         Counted(clips, "film") + Format(" (%.1f s), of which ", seconds) +
         (options.video_frames > 0 ? std::to_string(options.video_frames)
                                   : Concat(kLeastFrames, " to ", kMostFrames)) +
         " frames are picked";
}

}  // namespace regrade
