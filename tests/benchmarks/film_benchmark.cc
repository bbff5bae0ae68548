// Frames of a run's film in fewer rays (EQ(smooth-pixels)) against all rays, on the CPU:
//   film_benchmark DIR STYLE LONGER_SIDE FRAMES
// DIR is an output folder, STYLE the name of a finished style. Prints one line for each
// tolerance: rays, time, and the PSNR of the worst frame of both pictures. Of splats, which
// have no frames in fewer rays: the median frame's time and work, without a style (STYLE is not
// read).
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <vector>

#include "kernels/base/clock.h"
#include "kernels/base/error.h"
#include "kernels/field/cpu/render_film.h"
#include "kernels/render/field_renderer.h"
#include "kernels/splats/cpu/splat_frame.h"
#include "kernels/splats/splat_field.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/camera_path.h"
#include "pipeline/fields/film_timing.h"
#include "pipeline/stages/styled_field.h"
#include "tests/support/psnr.h"

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

void Compare(const std::string& folder, const std::string& style, int size, int frames) {
  const StoredField before = ReadFieldFile(folder + "/field.npz");
  const WorkingViews views = ReadWorkingViews(folder + "/poses", size, 0).InField(before);
  const std::vector<Camera> path =
      MakeCameraPath(views.Cameras(), PathOptions(), EvenMoments(frames));
  if (before.field.geometry->splats.on()) return TimeSplats(before.field, path);
  const StoredField after = ReadStyledField(folder, folder + "/styles/" + style);
  const FastGrid grid = MakeFastGrid(before.field), other = MakeFastGrid(after.field);
  const MarchOptions exact = before.field.march, early{exact.step, 1e-3f};
  struct Row {
    float tolerance;
    double seconds = 0, worst = 1e9;
    int64_t rays = 0;
  };
  std::vector<Row> rows;
  for (const float levels : {0.5f, 1.0f, 1.5f, 2.0f, 3.0f, 4.0f})
    rows.push_back({levels / 255});
  double exact_seconds = 0;
  int64_t pixels = 0;
  for (const Camera& camera : path) {
    const double begin = ClockSeconds();
    const RenderedPair all = RenderViewPair(grid, other, camera, exact);
    exact_seconds += ClockSeconds() - begin;
    pixels += int64_t{camera.width} * camera.height;
    for (Row& row : rows) {
      const double start = ClockSeconds();
      const FilmFrame frame = RenderFilmFrame(grid, other, camera, early, row.tolerance);
      row.seconds += ClockSeconds() - start;
      row.rays += frame.rays;
      row.worst = std::min({row.worst, testing::Psnr(frame.pair.view.color, all.view.color),
                            testing::Psnr(frame.pair.other_color, all.other_color)});
    }
  }
  std::printf("all rays: %.2f s for %d frames\n", exact_seconds, frames);
  for (const Row& row : rows)
    std::printf("tolerance %.1f/255: %4.1f %% of the rays, %.2f of the time, worst %.1f dB\n",
                255 * row.tolerance,
                100 * static_cast<double>(row.rays) / static_cast<double>(pixels),
                row.seconds / exact_seconds, row.worst);
}

}  // namespace
}  // namespace regrade

int main(int argc, char** argv) {
  if (argc != 5) {
    std::fprintf(stderr, "usage: film_benchmark DIR STYLE LONGER_SIDE FRAMES\n");
    return 2;
  }
  try {
    regrade::Compare(argv[1], argv[2], std::atoi(argv[3]), std::atoi(argv[4]));
  } catch (const regrade::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return static_cast<int>(error.code());
  }
  return 0;
}
