// pose_tool PHOTOS OUT [colmap]: stages a folder of pictures and estimates their poses, for
// manual measurements. Writes photos/, work/ and sparse/ to OUT.
#include <chrono>
#include <cstdio>
#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/capture/ingest_photos.h"
#include "reconstruct/colmap/poses_from_photos.h"
#include "reconstruct/scene/scene_checks.h"

namespace fs = std::filesystem;
using namespace regrade;

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: pose_tool PHOTOS OUT [colmap]\n");
    return 2;
  }
  const fs::path out = fs::absolute(argv[2]);
  PoseOptions options;
  if (argc > 3) options.colmap = argv[3];
  const auto start = std::chrono::steady_clock::now();
  const auto seconds = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  std::string last;
  const ProgressFunction progress = [&](const Progress& p) {
    const std::string line =
        std::to_string(static_cast<int>(20 * p.done / p.total) * 5) + " % " + p.note;
    if (line != last) std::printf("%6.1f s  %s\n", seconds(), line.c_str());
    last = line;
    return LoopControl::kContinue;
  };
  PoseReport report;
  try {
    const IngestResult ingest = IngestPhotos(argv[1], out / "photos", {}, {});
    std::printf("%zu photos after %.1f s, EXIF focal length %.1f px\n", ingest.photos.size(),
                seconds(), ingest.photos[0].exif_focal_px);
    const Capture capture = PosesFromPhotos(ingest.photos, ingest.statuses, options,
                                            out / "work", out / "sparse", progress, &report);
    const Vec3d extents = PointExtents(capture);
    const Camera& camera = capture.views[0].camera;
    std::printf(
        "registered %zu of %zu, %zu points, %.3f px, %d models, recipe \"%s\" (%d tried), lens "
        "%s\n"
        "angle %.2f deg, extents %.3g %.3g %.3g, fx %.2f fy %.2f cx %.2f cy %.2f, corner moved "
        "%.2f px, %.1f s\n",
        capture.views.size(), ingest.photos.size(), capture.points.size(),
        capture.reprojection_px, capture.models_found, report.strategy.c_str(),
        static_cast<int>(report.attempts.size()), report.lens.c_str(),
        MedianTriangulationAngle(capture) * 180 / M_PI, extents.x, extents.y, extents.z,
        camera.fx, camera.fy, camera.cx, camera.cy, camera.MaxCornerDistortion(), seconds());
    for (const PhotoStatus& photo : capture.statuses)
      if (photo.status != PhotoState::kUsed)
        std::printf("%s: %s: %s\n", photo.file.c_str(), ToString(photo.status),
                    photo.why.c_str());
    for (const std::string& note : report.notes) std::printf("note: %s\n", note.c_str());
  } catch (const Error& e) {
    std::printf("exit %d after %.1f s, %d attempts: %s\n", static_cast<int>(e.code()),
                seconds(), static_cast<int>(report.attempts.size()), e.what());
    return static_cast<int>(e.code());
  }
  return 0;
}
