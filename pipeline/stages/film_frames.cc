#include "pipeline/stages/film_frames.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/scene/common_camera.h"
#include "pipeline/fields/film_timing.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {
namespace {

// Widths of the smoothing that are tried, see MakeCameraPath.
constexpr double kWidths[] = {1, 0.5, 0.25, 0.1};
constexpr int kMeasuredMoments = 240;

}  // namespace

double WidthOfPath(const std::vector<Camera>& photos, const PathOptions& options,
                   const RadianceField& field, PathClearance* clearance) {
  double chosen = kWidths[0];
  *clearance = {-1, 0};
  for (const double width : kWidths) {
    const PathClearance of_width = MeasureClearance(
        field, photos, MakeCameraPath(photos, options, EvenMoments(kMeasuredMoments), width));
    if (of_width.transmittance > clearance->transmittance) {
      *clearance = of_width;
      chosen = width;
    }
    if (clearance->transmittance >= kClearTransmittance || options.path != "smooth") break;
  }
  return chosen;
}

FilmPath MakeFilmPath(const WorkingViews& views, const RenderOptions& options,
                      const RadianceField* field) {
  FilmPath path;
  path.transmittance = path.photo_distance =
      Metric::Undefined("the film shows the photos' own viewpoints");
  const std::vector<Camera> photos = views.Cameras();
  if (options.path.path == "views") {
    path.film = MakeCameraPath(photos, options.path, {});
    return path;
  }
  double width = kWidths[0];
  if (field == nullptr) {
    path.transmittance = path.photo_distance = Metric::Undefined("not measured");
  } else if (photos[0].ndc.on()) {
    path.transmittance = path.photo_distance =
        Metric::Undefined("a forward-facing field begins in front of all cameras");
  } else {
    PathClearance clearance;
    width = WidthOfPath(photos, options.path, *field, &clearance);
    path.transmittance = clearance.transmittance;
    path.photo_distance = clearance.photo_distance;
    path.narrowed = width != kWidths[0];
  }
  path.film = MakeCameraPath(views.AtSize(options.film_size).Cameras(), options.path,
                             EvenMoments(FilmFrames(options.film_seconds, options.fps)), width);
  path.samples = MakeCameraPath(
      photos, options.path, SamplesOfFilm(options.film_seconds, options.fps).moments, width);
  return path;
}

std::vector<FrameSet> FrameSetsOf(const WorkingViews& views, const RenderOptions& options,
                                  const FilmPath& path) {
  const std::vector<Camera> cameras = views.Cameras();
  const bool same = HaveSameIntrinsics(cameras), films = options.films.films,
             of_views = films && options.path.path == "views";
  std::vector<FrameSet> sets = {{"", cameras, true, of_views && same, of_views && same}};
  if (!same)
    sets.push_back({kCommonPrefix, WithCommonIntrinsics(cameras), true, of_views, of_views});
  if (of_views || !films) return sets;
  sets.push_back({kPathPrefix, path.samples, false, false, true});
  sets.push_back({kFilmPrefix, path.film, false, true, false});
  return sets;
}

std::string SmallerFilmNote(const RenderOptions& options, const std::vector<Camera>& film) {
  if (options.path.path == "views" || film.empty()) return "";
  const int longer = std::max(film[0].width, film[0].height);
  if (longer >= options.film_size) return "";
  return Concat("the film is capped at ", longer,
                " pixels, the photos' size (--film-size asks for ", options.film_size, ")");
}

std::string PlanOfFrames(const std::vector<FrameSet>& sets) {
  constexpr double kBytesPerPixel = 5;  // of three PNGs in colour and one in grey, measured
  std::string text;
  double pixels = 0;
  for (const FrameSet& set : sets) {
    const std::string size =
        Concat(" (", set.cameras[0].width, "x", set.cameras[0].height, " px), ");
    text += std::to_string(set.cameras.size());
    if (set.prefix == kCommonPrefix)
      text += " there with one camera" + size;
    else if (set.prefix == kFilmPrefix)
      text += " of the film" + size;
    else
      text += set.of_photos ? " frames at the photos' positions, "
                            : " where the film is measured, ";
    if (set.prefix == kFilmPrefix) continue;
    for (const Camera& camera : set.cameras)
      pixels += static_cast<double>(camera.width) * camera.height;
  }
  return text + "about " + std::to_string(std::lround(pixels * kBytesPerPixel * 1e-6)) +
         " MB of pictures";
}

int CountSamples(const RenderOptions& options) {
  if (options.path.path == "views" || !options.films.films) return 0;
  return static_cast<int>(SamplesOfFilm(options.film_seconds, options.fps).moments.size());
}

}  // namespace regrade
