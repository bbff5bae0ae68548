#include "pipeline/stages/frame_units.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "pipeline/images/video_writer.h"
#include "pipeline/run/film_parts.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {

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

double WorkOf(const FrameSet& set) {
  const Camera& camera = set.cameras[0];
  return 1e-6 * camera.width * camera.height * (set.prefix == kFilmPrefix ? 1.0 / 3 : 1);
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

}  // namespace regrade
