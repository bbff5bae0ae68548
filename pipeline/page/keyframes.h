// The film that a page's keyframes describe: camera_path.json, read and interpolated as the
// page does (web/path.js).
//
// Places are in the field's frame, times in seconds from the film's beginning.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "kernels/base/vec.h"
#include "kernels/scene/camera.h"

namespace regrade {

inline constexpr int kMostKeyframes = 1000, kMostPathStyles = 16;
inline constexpr double kLongestPath = 3600;  // seconds

struct Keyframe {
  double time = 0;
  Vec3d eye, forward, up;       // the last two of unit length, not parallel
  double half[2] = {1, 1};      // tangents of half the angles of view, across and down
  std::vector<double> weights;  // of each style; the rest to 1 is the unstyled scene
};

struct KeyframePath {
  std::vector<std::string> styles;  // PageStyleId of each
  std::vector<Keyframe> keyframes;  // times rise
  double fps = 0;                   // frames/s; 0: not said

  double Seconds() const { return keyframes.back().time; }
  // EQ(keyframe-path): places and directions as Catmull and Rom interpolate them, uniformly in
  // the keyframes, the end ones doubled; angles of view and weights linearly. With t in [0, 1]
  // between keyframes b and c, a before and d after them:
  // p(t) = b + t/2 (c - a + t (2a - 5b + 4c - d + t (3(b - c) + d - a))).
  // Directions are scaled to unit length; where they vanish or are parallel, b's are taken.
  Keyframe At(double seconds) const;
};

// Throws Error(kInput) with the line of what is wrong: at least one and at most kMostKeyframes
// keyframes, finite numbers within bounds, rising times, weights in [0, 1] with a sum of at
// most 1, one for each style.
KeyframePath ParseKeyframePath(std::string_view text, const std::string& where);
KeyframePath ReadKeyframePath(const std::string& path);

// The camera of a keyframe for a picture of width x height pixels: between the whole of the
// keyframe's angles of view and what fills the picture.
Camera CameraOfKeyframe(const Keyframe& key, int width, int height, const NdcSpace& ndc);

// Names a style in a page and in camera_path.json without its name: the beginning of the hash
// of its network. Throws Error(kInput) if the folder has none.
std::string PageStyleId(const std::string& style_folder);

}  // namespace regrade
