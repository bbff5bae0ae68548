// Photos of a synthetic scene with true poses, and points as from a pose estimate: the surface
// points of a pixel grid, observed by each view whose depth agrees.
#pragma once

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "kernels/synthetic/ray_trace.h"
#include "pipeline/capture/synth_effects.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/images/image_file.h"
#include "pipeline/workspace/output_names.h"
#include "reconstruct/colmap/colmap_model.h"

namespace regrade::testing {

struct SyntheticPhotos {
  std::string scene = "table";
  int views = 8, width = 200, height = 150;
  uint64_t seed = 4;
  int pixels_a_point = 10;  // in x and in y
  SynthEffects effects{.noise = true};
};

inline void AddPoint(const std::vector<Image>& depths, size_t view, int x, int y,
                     Capture* capture) {
  const Camera& camera = capture->views[view].camera;
  const double depth = *depths[view].at(x, y);
  if (depth <= 0) return;
  const RayT<double> ray = camera.WorldRay(x + 0.5, y + 0.5);
  ScenePoint point;
  point.position = ray.origin + ray.direction * (depth / Dot(ray.direction, camera.Forward()));
  for (size_t v = 0; v < depths.size(); ++v) {
    double u = 0, w = 0, z = 0;
    if (!capture->views[v].camera.Project(point.position, &u, &w, &z)) continue;
    if (!(u >= 0 && w >= 0 && u < camera.width && w < camera.height)) continue;
    const double there = *depths[v].at(static_cast<int>(u), static_cast<int>(w));
    if (std::abs(there - z) < 0.01 * z) point.views.push_back(static_cast<int32_t>(v));
  }
  if (point.views.size() >= 2) capture->points.push_back(point);
}

// Writes the photos to `folder`, which must exist.
inline Capture MakeSyntheticPhotos(const SyntheticPhotos& options, const std::string& folder) {
  const SyntheticScene scene = MakeSyntheticScene(options.scene, options.seed);
  Capture capture;
  std::vector<Image> depths;
  for (Camera camera : SyntheticCameras(scene, options.views, options.width, options.height)) {
    const int i = static_cast<int>(capture.views.size());
    camera = WithSynthLens(options.effects, camera);
    SyntheticView view = RenderSyntheticView(scene, camera, options.effects.highlights);
    if (options.effects.exposure)
      ApplyGain(SynthGain(options.seed, i, options.views), &view.color);
    if (options.effects.noise)
      ApplyNoise(options.seed, static_cast<uint64_t>(i), kSynthNoiseSigma, &view.color);
    const std::string name = FrameName(i), path = folder + "/" + name;
    WritePng8(path, view.color);
    depths.push_back(view.depth);
    capture.views.push_back({name, name, path, camera});
  }
  const int step = options.pixels_a_point;
  for (size_t v = 0; v < capture.views.size(); ++v)
    for (int y = step / 2; y < options.height; y += step)
      for (int x = step / 2; x < options.width; x += step) AddPoint(depths, v, x, y, &capture);
  return capture;
}

// The same as a COLMAP workspace: images/ and sparse/0/.
inline void WriteSyntheticWorkspace(const SyntheticPhotos& options, const std::string& folder) {
  std::filesystem::create_directories(folder + "/images");
  std::filesystem::create_directories(folder + "/sparse/0");
  const Capture capture = MakeSyntheticPhotos(options, folder + "/images");
  ColmapModel model;
  for (size_t v = 0; v < capture.views.size(); ++v) {
    const CaptureView& view = capture.views[v];
    const auto id = static_cast<uint32_t>(v + 1);
    const ColmapLens lens = view.camera.lens == LensModel::kPinhole ? ColmapLens::kPinhole
                            : view.camera.lens == LensModel::kOpenCv
                                ? ColmapLens::kOpenCv
                                : ColmapLens::kOpenCvFisheye;
    model.cameras.push_back({id, lens, view.camera});
    model.images.push_back({id, id, view.name, view.camera.camera_from_world, {}});
  }
  for (const ScenePoint& seen : capture.points) {
    ColmapPoint point{model.points.size() + 1, seen.position, {}, 0, {}};
    for (const int32_t v : seen.views) {
      ColmapImage& image = model.images[static_cast<size_t>(v)];
      point.track.push_back({image.id, static_cast<uint32_t>(image.keypoints.size())});
      ColmapKeypoint keypoint{0, 0, point.id};
      capture.views[static_cast<size_t>(v)].camera.Project(seen.position, &keypoint.u,
                                                           &keypoint.v);
      image.keypoints.push_back(keypoint);
    }
    model.points.push_back(point);
  }
  WriteColmapModel(model, folder + "/sparse/0");
}

}  // namespace regrade::testing
