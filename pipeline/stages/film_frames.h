// The cameras of a run's frames: at the photos' places, along the film, and where the film is
// measured.
#pragma once

#include <string>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/camera_path.h"
#include "pipeline/fields/path_clearance.h"
#include "pipeline/report/stage_metrics.h"
#include "pipeline/run/run_settings.h"

namespace regrade {

// Frames of one kind. Those with a prefix that is not kFilmPrefix are written to
// frames/PREFIX{source, ...}.
struct FrameSet {
  std::string prefix;
  std::vector<Camera> cameras;
  bool of_photos = false;   // camera i is at photo i's position
  bool of_film = false;     // the film shows them
  bool of_2d_film = false;  // the 2D method's film shows them
};

// Of frames that are only in the film.
inline constexpr char kFilmPrefix[] = "film_";

// The film's way through the scene.
struct FilmPath {
  std::vector<Camera> film;              // of the film's size
  std::vector<Camera> samples;           // of the photos' working size; see SamplesOfFilm
  Metric transmittance, photo_distance;  // see PathClearance
  bool narrowed = false;                 // a smoother path would pass through surfaces
};

// `views` in the frame of `field`. Without a field nothing is measured. "smooth" keeps so close
// to the photos' tour that it does not pass through surfaces, where that is possible.
FilmPath MakeFilmPath(const WorkingViews& views, const RenderOptions& options,
                      const RadianceField* field);

// The width for MakeCameraPath: of the widest smoothing whose path is clear in `field`, or else
// of the clearest one, whose clearance it gives. Cameras in the field's frame.
double WidthOfPath(const std::vector<Camera>& photos, const PathOptions& options,
                   const RadianceField& field, PathClearance* clearance);

// All frames of a run: at the photos' places, with one camera where photos differ in size or
// lens, the film's samples, and the film. With --path views the film is made of frames at the
// photos' places, with --no-films there is none.
std::vector<FrameSet> FrameSetsOf(const WorkingViews& views, const RenderOptions& options,
                                  const FilmPath& path);

// That a film of these cameras is smaller than --film-size, and why; empty where it is not, or
// where the size of photos decides (--path views).
std::string SmallerFilmNote(const RenderOptions& options, const std::vector<Camera>& film);

// "24 frames at the photos' positions, 24 there with one camera (480x360 px), 60 where the film
// is measured, 180 of the film (480x360 px), about 53 MB of pictures".
std::string PlanOfFrames(const std::vector<FrameSet>& sets);

// Frames on disk along the film's path, an excerpt of the film's time after the other; 0 with
// --path views and --no-films.
int CountSamples(const RenderOptions& options);

}  // namespace regrade
