// Picks the frames of films that serve as photos: sharp ones, a step of the camera apart.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/scene/image.h"
#include "pipeline/images/video_reader.h"

namespace regrade {

// Of a frame that was decoded.
struct FrameMeasure {
  double seconds = 0;    // since the film's first frame
  double sharpness = 0;  // see SharpnessOf
  double travel = 0;     // steps of the camera since the first frame; never decreases
};

struct ClipSurvey {
  std::string file;  // the user's name
  std::string path;
  VideoInfo info;
  std::vector<FrameMeasure> frames;
  int64_t damaged = 0, interlaced = 0;  // frames
  std::string problem;                  // why the film cannot be used; empty if it can

  double Travel() const { return frames.empty() ? 0 : frames.back().travel; }
};

// One step: the image moves by this fraction of its longer side, or depths move against each
// other by that. Photos of a usual capture are one to three such steps apart.
inline constexpr double kMotionStep = 0.06, kParallaxStep = 0.01;
inline constexpr int kLeastFrames = 40, kMostFrames = 120;

// Of a grey picture [H, W, 1]: the mean squared difference to the pixels on the right and
// below, over the variance of its values, to which 1e-4 is added. Brightness does not change
// it.
double SharpnessOf(const Image& grey);

// Decodes the whole film once, with two small grey frames in memory. What is wrong with the
// file becomes its problem. Throws Interrupted.
ClipSurvey SurveyClip(const std::string& file, const std::string& path,
                      const VideoLimits& limits, const ProgressFunction& progress);

// Indices of the picked frames of each film, ascending. `wanted` frames in all, of kLeastFrames
// to kMostFrames by the films' travel if it is 0; the films get shares in proportion to their
// travel, and a few frames each at least. Each film is divided into as many parts of equal
// travel, and of each part the sharpest frame is taken; parts without a frame are not filled,
// so that fewer can remain.
std::vector<std::vector<size_t>> PickFrames(const std::vector<ClipSurvey>& clips, int wanted);

// The user's name of a picked frame: "CLIP.mp4/003.250s.png".
std::string FrameName(const std::string& clip, double seconds);

}  // namespace regrade
