// walk_clip OUT [FRAMES [WIDTH HEIGHT]]: a hand-held walk through the synthetic still life, for
// tests/scripts/film_against_photos.py. Writes OUT/walk.mp4 at 30 frames/s and the same frames
// as OUT/frames/00000.png, ...
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/scene/srgb.h"
#include "kernels/synthetic/ray_trace.h"
#include "pipeline/images/image_file.h"
#include "pipeline/images/video_writer.h"

namespace {

using namespace regrade;

constexpr double kFramesPerSecond = 30;
// The shutter is open for half of each frame.
constexpr int kMoments = 4;
constexpr double kShutter = 0.5;
// A hand's shaking: amplitudes of three waves each, at 1 to 9 Hz.
constexpr double kTurn = 0.35 * M_PI / 180, kStep = 0.006;  // radians, metres

double Shake(double seconds, uint64_t axis) {
  double sum = 0;
  for (uint64_t wave = 0; wave < 3; ++wave) {
    const double hertz = 1 + 8 * RandomDouble(7, axis, 2 * wave);
    const double phase = 2 * M_PI * RandomDouble(7, axis, 2 * wave + 1);
    sum += std::sin(2 * M_PI * hertz * seconds + phase);
  }
  return sum;
}

Camera Shaken(Camera camera, double seconds) {
  const auto small = [&](uint64_t axis, double size) { return size * Shake(seconds, axis); };
  const double a = small(0, kTurn), b = small(1, kTurn), c = small(2, kTurn);
  const Vec3d center =
      camera.Center() + Vec3d{small(3, kStep), small(4, kStep), small(5, kStep)};
  Mat3d& rotation = camera.camera_from_world.rotation;
  // Turns about x, y, z, one after the other.
  const double turns[3] = {a, b, c};
  for (int axis = 0; axis < 3; ++axis) {
    const Mat3d now = rotation;
    const int i = (axis + 1) % 3, j = (axis + 2) % 3;
    const double s = std::sin(turns[axis]), k = std::cos(turns[axis]);
    rotation.row[i] = k * now.row[i] - s * now.row[j];
    rotation.row[j] = s * now.row[i] + k * now.row[j];
  }
  camera.camera_from_world.translation = -(rotation * center);
  return camera;
}

// The mean light of the moments in which the shutter is open.
Image Frame(const SyntheticScene& scene, const std::vector<Camera>& cameras, int frame) {
  Image light;
  for (int moment = 0; moment < kMoments; ++moment) {
    const double when = frame + kShutter * moment / kMoments;
    const Camera camera = Shaken(cameras[static_cast<size_t>(frame * kMoments + moment)],
                                 when / kFramesPerSecond);
    const Image color = RenderSyntheticView(scene, camera).color;
    if (light.empty()) light = Image(color.width, color.height, color.channels);
    for (size_t i = 0; i < color.pixels.size(); ++i)
      light.pixels[i] += static_cast<float>(LinearFromSrgb(color.pixels[i]) / kMoments);
  }
  for (float& v : light.pixels) v = static_cast<float>(SrgbFromLinear(v));
  return light;
}

// Cameras at the moments; `SyntheticCameras` divides the path evenly.
std::vector<Camera> Moments(const SyntheticScene& scene, int frames, int width, int height) {
  const int fine = static_cast<int>(kMoments / kShutter);
  const std::vector<Camera> all = SyntheticCameras(scene, frames * fine, width, height);
  std::vector<Camera> cameras;
  for (int frame = 0; frame < frames; ++frame)
    for (int moment = 0; moment < kMoments; ++moment)
      cameras.push_back(all[static_cast<size_t>(frame * fine + moment)]);
  return cameras;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2 && argc != 3 && argc != 5) {
    std::fprintf(stderr, "usage: walk_clip OUT [FRAMES [WIDTH HEIGHT]]\n");
    return 2;
  }
  const std::string out = argv[1];
  const int frames = argc > 2 ? std::atoi(argv[2]) : 240;
  const int width = argc > 4 ? std::atoi(argv[3]) : 480;
  const int height = argc > 4 ? std::atoi(argv[4]) : 360;
  try {
    const SyntheticScene scene = MakeSyntheticScene("table", 0);
    const std::vector<Camera> cameras = Moments(scene, frames, width, height);
    std::filesystem::create_directories(out + "/frames");
    VideoWriter film(out + "/walk.mp4", width, height, kFramesPerSecond);
    for (int i = 0; i < frames; ++i) {
      const Image frame = Frame(scene, cameras, i);
      WritePng8(Format("%s/frames/%05d.png", out.c_str(), i), frame);
      film.Add(frame);
    }
    film.Finish();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
