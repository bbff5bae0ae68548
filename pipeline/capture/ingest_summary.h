// What is said of the files that were taken in: one sentence for each kind of event, one line
// for all, and the refusal of too few.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "pipeline/capture/clip_frames.h"

namespace regrade {

// Reports each kind once: "12 photos: <what> (the first is a.jpg)".
class IngestNotices {
 public:
  void Add(const std::string& what, const std::string& file);
  // Colours that were converted to sRGB and the fraction of values that were clamped then
  // (normalize_photo.h): one sentence for all photos with the same colours.
  void AddColors(const std::string& colors, double clipped, const std::string& file);
  void AddClip(const ClipSurvey& clip, size_t frames);
  std::vector<std::string> Texts() const;

 private:
  struct Kind {
    std::string first;
    int count = 0;
    double clipped = 0, most_clipped = 0;  // sum and largest, fractions
  };
  void Count(std::map<std::string, Kind>* kinds, const std::string& what,
             const std::string& file, double clipped);

  std::map<std::string, Kind> kinds_, colors_;
  std::vector<std::string> order_;  // of kinds_
  std::vector<std::string> clips_;
};

// "taken: 24 photos (4032 x 3024), 52 frames of CLIP.mov; left: 3 x live-photo clip". Empty
// where every file is a photo of one camera. `left`: counts by what the files are.
std::string TakenAndLeft(const std::vector<StagedPhoto>& photos,
                         const std::vector<ClipSurvey>& clips,
                         const std::map<std::string, int>& left);

// Throws Error(kInput) for no photo, Error(kScene) for 1 or 2. `hidden`: files whose name
// begins with a dot.
void RequireEnoughPhotos(size_t usable, const std::vector<PhotoStatus>& statuses, int hidden,
                         const std::string& where);

}  // namespace regrade
