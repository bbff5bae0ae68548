// When a film's frames are, and those on which it is measured.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace regrade {

// At least two.
inline int FilmFrames(double seconds, double frames_per_second) {
  return std::max(2, static_cast<int>(std::lround(seconds * frames_per_second)));
}

// Parts of the film's time, 0 at the first frame and 1 at the last.
inline std::vector<double> EvenMoments(int frames) {
  std::vector<double> moments(static_cast<size_t>(frames));
  for (int i = 0; i < frames; ++i)
    moments[static_cast<size_t>(i)] = static_cast<double>(i) / std::max(1, frames - 1);
  return moments;
}

// The moments at which the 2D method and the metrics look at a film: kSampleRate a second,
// whatever its frame rate and size, so that frames 1 and 5 apart are 1/24 and 5/24 s apart. Of
// a film with more than kMostSamples of them, kExcerpts excerpts, evenly spread over its time.
inline constexpr double kSampleRate = 24;
inline constexpr int kMostSamples = 60, kExcerpts = 3;

struct FilmSamples {
  std::vector<double> moments;
  int excerpt = 0;  // samples of an excerpt; pairs across two excerpts are no neighbours
};

inline FilmSamples SamplesOfFilm(double seconds, double frames_per_second) {
  const double length =
      (FilmFrames(seconds, frames_per_second) - 1) / frames_per_second;  // seconds
  // The last frame counts in spite of rounding.
  const int all = std::max(2, static_cast<int>(std::floor(length * kSampleRate + 1e-6)) + 1);
  FilmSamples samples;
  const auto add = [&](int k) {
    samples.moments.push_back(std::min(1.0, k / (kSampleRate * length)));
  };
  if (all <= kMostSamples) {
    samples.excerpt = all;
    for (int k = 0; k < all; ++k) add(k);
    return samples;
  }
  samples.excerpt = kMostSamples / kExcerpts;
  for (int e = 0; e < kExcerpts; ++e) {
    const int first = static_cast<int>((e + 0.5) / kExcerpts * all) - samples.excerpt / 2;
    for (int k = 0; k < samples.excerpt; ++k) add(first + k);
  }
  return samples;
}

}  // namespace regrade
