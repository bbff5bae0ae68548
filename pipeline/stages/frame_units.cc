#include "pipeline/stages/frame_units.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "pipeline/images/video_writer.h"
#include "pipeline/run/film_parts.h"
#include "pipeline/run/plan.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {
namespace {

// Of a frame: its pixels, in millions, of which those that are only in the film cost a third
// (pipeline/run/stage_estimate.cc).
double WorkOf(const FrameSet& set) {
  const Camera& camera = set.cameras[0];
  return 1e-6 * camera.width * camera.height * (set.prefix == kFilmPrefix ? 1.0 / 3 : 1);
}

}  // namespace

std::string FrameUnit::Name() const {
  return (set->prefix.empty() ? "views_" : set->prefix) + Format("%05d", begin);
}

std::string FrameUnit::Text() const {
  const std::string of = set->prefix == kFilmPrefix     ? "of the film"
                         : set->prefix == kPathPrefix   ? "where the film is measured"
                         : set->prefix == kCommonPrefix ? "with one camera"
                                                        : "at the photos' positions";
  return Concat("frames ", begin, " to ", end - 1, " ", of);
}

std::vector<FrameUnit> UnitsOf(const std::vector<FrameSet>& sets) {
  std::vector<FrameUnit> units;
  for (const FrameSet& set : sets) {
    const int frames = static_cast<int>(set.cameras.size());
    for (int begin = 0; begin < frames; begin += kFilmGroup)
      units.push_back({&set, begin, std::min(begin + kFilmGroup, frames)});
  }
  return units;
}

std::vector<FrameUnit> UnitsOfPart(const std::vector<FrameUnit>& units,
                                   const std::string& part) {
  const auto [number, parts] = ParsePart(part);
  std::vector<FrameUnit> own;
  for (size_t i = static_cast<size_t>(number - 1); i < units.size();
       i += static_cast<size_t>(parts))
    own.push_back(units[i]);
  return own;
}

std::vector<std::vector<FrameUnit>> BatchesWithin(const std::vector<FrameUnit>& units,
                                                  int64_t splats, uint64_t memory) {
  constexpr double kSplatBytes = 400;
  if (splats == 0 || memory == 0 ||
      kProgramBytes + kSplatBytes * static_cast<double>(splats) <= static_cast<double>(memory))
    return {units};
  std::vector<std::vector<FrameUnit>> each;
  for (const FrameUnit& unit : units) each.push_back({unit});
  return each;
}

std::vector<Camera> CamerasOf(const std::vector<FrameUnit>& units) {
  std::vector<Camera> cameras;
  for (const FrameUnit& unit : units)
    cameras.insert(cameras.end(), unit.set->cameras.begin() + unit.begin,
                   unit.set->cameras.begin() + unit.end);
  return cameras;
}

std::function<void(const FrameSet&)> TickOf(const std::vector<FrameUnit>& units,
                                            const ProgressFunction& progress) {
  double work = 0;
  for (const FrameUnit& unit : units) work += WorkOf(*unit.set) * (unit.end - unit.begin);
  return [progress, work, done = 0.0](const FrameSet& set) mutable {
    ReportOrThrow(progress, done, work);
    done += WorkOf(set);
  };
}

}  // namespace regrade
