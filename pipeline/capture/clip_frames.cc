#include "pipeline/capture/clip_frames.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "evaluate/flow_parallax.h"
#include "evaluate/optical_flow.h"
#include "kernels/base/error.h"
#include "kernels/image/resize.h"

namespace regrade {
namespace {

// Sides at which sharpness and motion are measured, pixels: a blur of a thousandth of the frame
// is seen, and a step is 19 pixels.
constexpr int kSharpSide = 960, kFlowSide = 320;
constexpr double kMostSteps = 3;        // of one frame: more is a cut, or a flow that failed
constexpr size_t kLeastOfEachClip = 8;  // frames
// Finer divisions are tried until so many frames remain.
constexpr double kFinerBy = 1.25;
constexpr int kDivisions = 12;

Image Smaller(const Image& grey) {
  const double scale =
      std::min(1.0, static_cast<double>(kFlowSide) / std::max(grey.width, grey.height));
  const auto side = [scale](int full) {
    return std::max(kLeastFlowSide, static_cast<int>(std::lround(full * scale)));
  };
  return Resize(grey, side(grey.width), side(grey.height));
}

double StepsBetween(const Image& from, const Image& to) {
  const FlowMotion moved = MeasureFlowMotion(ComputeFlow(from, to, "dis-fast"));
  const double side = std::max(from.width, from.height);
  return std::min(kMostSteps,
                  std::max(moved.motion / kMotionStep, moved.parallax / kParallaxStep) / side);
}

// The travel of one frame after the other. Motion is measured from a reference, which moves on
// after each whole step: the shaking of a hand does not add up.
class Traveller {
 public:
  double Add(const Image& grey) {
    Image small = Smaller(grey);
    if (!reference_.empty()) {
      const double steps = StepsBetween(reference_, small);
      travel_ = std::max(travel_, base_ + steps);
      if (steps >= 1) {
        base_ += steps;
        reference_ = std::move(small);
      }
    } else {
      reference_ = std::move(small);
    }
    return travel_;
  }

 private:
  Image reference_;
  double base_ = 0;    // at the reference
  double travel_ = 0;  // so far
};

// The sharpest frame of each of `parts` parts of equal travel.
std::vector<size_t> SharpestOfParts(const std::vector<FrameMeasure>& frames, size_t parts) {
  std::vector<size_t> picked;
  const double travel = frames.back().travel, seconds = frames.back().seconds;
  // A camera that stands still has parts of equal time.
  const auto place = [&](size_t i) {
    if (travel > 0) return frames[i].travel / travel;
    if (seconds > 0) return frames[i].seconds / seconds;
    return static_cast<double>(i) / static_cast<double>(frames.size());
  };
  size_t last = parts;  // none
  for (size_t i = 0; i < frames.size(); ++i) {
    const size_t part =
        std::min(parts - 1, static_cast<size_t>(place(i) * static_cast<double>(parts)));
    if (part != last)
      picked.push_back(i);
    else if (frames[i].sharpness > frames[picked.back()].sharpness)
      picked.back() = i;
    last = part;
  }
  return picked;
}

std::vector<size_t> PickFramesOfClip(const std::vector<FrameMeasure>& frames, size_t wanted) {
  std::vector<size_t> all(frames.size());
  std::iota(all.begin(), all.end(), size_t{0});
  if (frames.size() <= wanted) return all;
  std::vector<size_t> best;
  double parts = static_cast<double>(wanted);
  for (int i = 0; i < kDivisions && best.size() < wanted; ++i, parts *= kFinerBy) {
    std::vector<size_t> picked = SharpestOfParts(frames, static_cast<size_t>(parts));
    if (picked.size() <= wanted) best = std::move(picked);
  }
  return best;
}

}  // namespace

double SharpnessOf(const Image& grey) {
  const double n = static_cast<double>(grey.num_pixels());
  double sum = 0;
  for (const float v : grey.pixels) sum += v;
  const double mean = sum / n;
  double squares = 0, gradient = 0;
  for (int y = 0; y < grey.height; ++y)
    for (int x = 0; x < grey.width; ++x) {
      const double v = *grey.at(x, y);
      squares += (v - mean) * (v - mean);
      const double dx = x + 1 < grey.width ? *grey.at(x + 1, y) - v : 0;
      const double dy = y + 1 < grey.height ? *grey.at(x, y + 1) - v : 0;
      gradient += dx * dx + dy * dy;
    }
  return gradient / n / (squares / n + 1e-4);
}

ClipSurvey SurveyClip(const std::string& file, const std::string& path,
                      const VideoLimits& limits, const ProgressFunction& progress) {
  ClipSurvey clip;
  clip.file = file;
  clip.path = path;
  try {
    VideoReader reader(path, limits);
    clip.info = reader.info();
    const double total = static_cast<double>(std::max<int64_t>(clip.info.frames, 1));
    Traveller traveller;
    while (reader.Next()) {
      const Image grey = reader.Grey(kSharpSide);
      clip.frames.push_back({reader.seconds(), SharpnessOf(grey), traveller.Add(grey)});
      const double seconds = clip.info.seconds > 0 ? reader.seconds() / clip.info.seconds : 0;
      ReportOrThrow(progress, std::min(total, seconds * total), total,
                    Concat(file, ": ", clip.frames.size(), " frames looked at"));
    }
    clip.damaged = reader.damaged();
    clip.interlaced = reader.interlaced();
  } catch (const Error& error) {
    if (error.code() != ExitCode::kInput) throw;
    clip.frames.clear();
    clip.problem = error.what_failed();
    if (!error.hint().empty()) clip.problem += "; " + error.hint();
  }
  return clip;
}

std::vector<std::vector<size_t>> PickFrames(const std::vector<ClipSurvey>& clips, int wanted) {
  double travel = 0;
  for (const ClipSurvey& clip : clips) travel += clip.Travel();
  if (wanted == 0)
    wanted = static_cast<int>(
        std::lround(std::clamp(travel, kLeastFrames * 1.0, kMostFrames * 1.0)));
  std::vector<std::vector<size_t>> picked;
  for (const ClipSurvey& clip : clips) {
    const double share =
        travel > 0 ? clip.Travel() / travel : 1.0 / static_cast<double>(clips.size());
    const size_t count =
        std::max(std::min<size_t>(kLeastOfEachClip, static_cast<size_t>(wanted)),
                 static_cast<size_t>(std::lround(share * wanted)));
    picked.push_back(clip.frames.empty() ? std::vector<size_t>()
                                         : PickFramesOfClip(clip.frames, count));
  }
  return picked;
}

std::string FrameName(const std::string& clip, double seconds) {
  return clip + Format("/%07.3fs.png", seconds);
}

}  // namespace regrade
