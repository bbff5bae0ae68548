// Frames of a film of splats on the CPU:
//   film_benchmark DIR LONGER_SIDE FRAMES
// DIR is an output folder. Prints the median frame's time and work, without a style.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <vector>

#include "kernels/base/clock.h"
#include "kernels/base/error.h"
#include "kernels/render/field_renderer.h"
#include "kernels/splats/cpu/splat_frame.h"
#include "kernels/splats/splat_field.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/camera_path.h"
#include "pipeline/fields/film_timing.h"

namespace regrade {
namespace {

template <typename T>
T MedianOf(std::vector<T> values) {
  std::ranges::nth_element(values, values.begin() + std::ssize(values) / 2);
  return values[values.size() / 2];
}

void TimeSplats(const RadianceField& field, const std::vector<Camera>& path) {
  const FieldRenderer renderer(field, Backend::kCpu);
  std::vector<double> whole, processor;
  std::vector<int64_t> seen, entries;
  for (Camera camera : path) {
    camera.ndc = {};
    const double begin = ClockSeconds();
    const std::clock_t used = std::clock();
    renderer.Render(camera);
    whole.push_back(ClockSeconds() - begin);
    processor.push_back(static_cast<double>(std::clock() - used) / CLOCKS_PER_SEC);
    const SplatFrame frame = MakeSplatFrame(SplatsOf(field), camera, SplatOptionsOf(field));
    seen.push_back(
        std::ranges::count_if(frame.box, [](const PixelBox& box) { return !box.empty(); }));
    entries.push_back(std::ssize(frame.entry_splat));
  }
  std::printf(
      "median of %zu frames of %dx%d: %.1f ms, %.1f ms of the processor; %lld of %lld splats "
      "seen, %lld entries of tiles\n",
      path.size(), path[0].width, path[0].height, 1e3 * MedianOf(whole),
      1e3 * MedianOf(processor), static_cast<long long>(MedianOf(seen)),
      static_cast<long long>(field.geometry->num_voxels()),
      static_cast<long long>(MedianOf(entries)));
}

void TimeFilm(const std::string& folder, int size, int frames) {
  const StoredField before = ReadFieldFile(folder + "/field.npz");
  const WorkingViews views = ReadWorkingViews(folder + "/poses", size, 0).InField(before);
  const std::vector<Camera> path =
      MakeCameraPath(views.Cameras(), PathOptions(), EvenMoments(frames));
  TimeSplats(before.field, path);
}

}  // namespace
}  // namespace regrade

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: film_benchmark DIR LONGER_SIDE FRAMES\n");
    return 2;
  }
  try {
    regrade::TimeFilm(argv[1], std::atoi(argv[2]), std::atoi(argv[3]));
  } catch (const regrade::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return static_cast<int>(error.code());
  }
  return 0;
}
