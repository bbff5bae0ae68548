// Which photos of a capture are held out.
#include "kernels/scene/capture.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/quantile.h"

namespace regrade {
namespace {

// Cameras are at one place if they are no farther apart than this fraction of the distance of
// nine tenths of them from their middle, and look the same way. The median distance would be
// that within a burst where most photos belong to one.
constexpr double kSamePlace = 0.01, kMostCameras = 0.9;
constexpr double kSameWayDeg = 3;

double DistanceFromMiddle(const std::vector<Vec3d>& centers) {
  Vec3d middle;
  for (int a = 0; a < 3; ++a) {
    std::vector<double> along;
    for (const Vec3d& center : centers) along.push_back(center[a]);
    middle[a] = Median(std::move(along));
  }
  std::vector<double> distances;
  for (const Vec3d& center : centers) distances.push_back(Norm(center - middle));
  return Quantile(std::move(distances), kMostCameras);
}

// The views at each place, in order of the first. Each is near the first one of its place, so
// that a long row of near photos does not become one place.
std::vector<std::vector<size_t>> PlacesOf(const Capture& capture) {
  std::vector<Vec3d> centers, forwards;
  for (const CaptureView& view : capture.views) {
    centers.push_back(view.camera.Center());
    forwards.push_back(view.camera.Forward());
  }
  const double near = kSamePlace * DistanceFromMiddle(centers);
  const double cosine = std::cos(kSameWayDeg * M_PI / 180);
  std::vector<std::vector<size_t>> places;
  for (size_t i = 0; i < centers.size(); ++i) {
    const auto place = std::ranges::find_if(places, [&](const std::vector<size_t>& views) {
      return Norm(centers[views[0]] - centers[i]) <= near &&
             Dot(forwards[views[0]], forwards[i]) >= cosine;
    });
    if (place != places.end())
      place->push_back(i);
    else
      places.push_back({i});
  }
  return places;
}

}  // namespace

bool HasTestSplit(const Capture& capture) {
  size_t test = 0;
  for (const CaptureView& view : capture.views) test += view.test;
  return test > 0 && test < capture.views.size();
}

std::vector<bool> HeldOutViews(const Capture& capture, int holdout) {
  const size_t views = capture.views.size();
  std::vector<bool> held_out(views, false);
  if (holdout <= 0 || capture.rendered) return held_out;
  if (HasTestSplit(capture)) {
    for (size_t i = 0; i < views; ++i) held_out[i] = capture.views[i].test;
    return held_out;
  }
  const std::vector<std::vector<size_t>> places = PlacesOf(capture);
  size_t held = 0, next = 0;
  for (size_t p = 0; p < places.size(); ++p) {
    const size_t with = held + places[p].size();
    if (p < next || with > (views + 1) / 2 || with + 2 > views) continue;
    for (const size_t view : places[p]) held_out[view] = true;
    held = with;
    next = p + static_cast<size_t>(holdout);
  }
  return held_out;
}

std::vector<std::string> FilesOf(const Capture& capture) {
  std::vector<std::string> files;
  for (const CaptureView& view : capture.views) files.push_back(view.file);
  return files;
}

int64_t LargestPhotoBytes(const Capture& capture) {
  constexpr int64_t kOfPixel = 2 * 3 * sizeof(float);  // as decoded, and once more
  int64_t most = 0;
  for (const CaptureView& view : capture.views)
    most = std::max(most, int64_t{view.camera.width} * view.camera.height);
  return kOfPixel * most;
}

}  // namespace regrade
