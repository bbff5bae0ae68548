// Where the hues of a style go on the way from the 2D method to the styled scene.
//
//   hue_benchmark [--quick] OUT STYLE [STYLE...]
//
// OUT is the folder of a run, and the first STYLE a style of it that was rendered: its 2D
// frames are what all rows are compared with, and the networks of the further styles, trained
// on the same picture with other options, make a row each. All at the photos' places, at the
// run's size. Rows: the 2D method; one linear map for all frames, on pixels and carried into
// the field; the ceiling, the least squares of one more colour at each voxel, and of all
// voxels' coefficients, to the 2D frames; the networks with their residuals, if they have
// one, and each network's colour map alone. --quick leaves out the ceilings, which take
// minutes. Columns: hue spread of all frames over the 2D method's; the same of each frame by
// itself, the mean over frames; the first without pixels whose 2D lightness is below 10; chroma
// over the 2D method's; PSNR to the 2D frames. The heading says how many of the 2D frames'
// pixels have a channel at 0 or 255.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/field/pad_sh_basis.h"
#include "kernels/image/color_spaces.h"
#include "kernels/image/hue_chroma.h"
#include "kernels/scene/srgb.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/network_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/stages/styled_field.h"
#include "stylize/field/base_map.h"
#include "stylize/field/coefficient_fit.h"
#include "stylize/linear_map.h"

namespace regrade {
namespace {

constexpr double kDark = 10;  // CIELAB lightness

std::vector<Image> RendersOf(const RadianceField& field, const std::vector<Camera>& cameras) {
  std::vector<Image> pictures;
  const FastGrid grid = MakeFastGrid(field);
  for (const Camera& camera : cameras)
    pictures.push_back(RenderView(grid, camera, field.march).color);
  return pictures;
}

Vec3d ColorAt(const Image& image, int64_t i) {
  const float* p = &image.pixels[static_cast<size_t>(3 * i)];
  return {p[0], p[1], p[2]};
}

Image LightPixels(const Image& image) {
  Image mask(image.width, image.height, 1);
  for (int64_t i = 0; i < image.num_pixels(); ++i) {
    Vec3d light = ColorAt(image, i);
    for (int c = 0; c < 3; ++c) light[c] = LinearFromSrgb(std::clamp(light[c], 0.0, 1.0));
    mask.pixels[static_cast<size_t>(i)] = LabFromLinear(light).x >= kDark ? 1.0f : 0.0f;
  }
  return mask;
}

struct Hues {
  double all = 0, of_frames = 0, light = 0, chroma = 0;
};

Hues HuesOf(const std::vector<Image>& frames, const std::vector<Image>& light) {
  HueChroma all, of_light;
  Hues hues;
  for (size_t i = 0; i < frames.size(); ++i) {
    HueChroma frame;
    frame.Add(frames[i]);
    all += frame;
    of_light.Add(frames[i], &light[i]);
    hues.of_frames += frame.HueStd().value_or(0) / static_cast<double>(frames.size());
  }
  hues.all = all.HueStd().value_or(0);
  hues.light = of_light.HueStd().value_or(0);
  hues.chroma = all.MeanChroma().value_or(0);
  return hues;
}

double Decibels(const std::vector<Image>& a, const std::vector<Image>& b) {
  double sum = 0, count = 0;
  for (size_t i = 0; i < a.size(); ++i)
    for (size_t k = 0; k < a[i].pixels.size(); ++k, ++count) {
      const double d = double{a[i].pixels[k]} - double{b[i].pixels[k]};
      sum += d * d;
    }
  return -10 * std::log10(std::max(1e-12, sum / count));
}

void Clip(std::vector<Image>* frames) {
  for (Image& frame : *frames)
    for (float& v : frame.pixels) v = std::clamp(v, 0.0f, 1.0f);
}

int Run(bool quick, const std::string& out, const std::vector<std::string>& styles) {
  const JsonValue options = ReadJsonFile(out + "/run.json", 1 << 24).At("options");
  StoredField source = ReadFieldFile(out + "/field.npz");
  source.field.appearance = PadShBasis(std::move(source.field.appearance), 9);
  const WorkingViews views =
      ReadWorkingViews(out + "/poses", static_cast<int>(options.At("photo-size").AsInt()), 0)
          .InField(source);
  const std::vector<Camera> cameras = views.Cameras();
  std::vector<Image> of_method, light;
  double clipped = 0, pixels = 0;
  for (size_t i = 0; i < cameras.size(); ++i) {
    of_method.push_back(ReadImage(out + "/styles/" + styles[0] + "/frames/views_2d/" +
                                  Format("%05d.png", static_cast<int>(i))));
    light.push_back(LightPixels(of_method.back()));
    for (int64_t k = 0; k < of_method.back().num_pixels(); ++k, ++pixels) {
      const Vec3d c = ColorAt(of_method.back(), k);
      if (std::min({c.x, c.y, c.z}) <= 0 || std::max({c.x, c.y, c.z}) >= 1) ++clipped;
    }
  }
  const Hues reference = HuesOf(of_method, light);
  const auto row = [&](const std::string& what, std::vector<Image> frames) {
    Clip(&frames);
    const Hues hues = HuesOf(frames, light);
    std::printf("| %s | %.3f | %.3f | %.3f | %.3f | %.2f |\n", what.c_str(),
                hues.all / reference.all, hues.of_frames / reference.of_frames,
                hues.light / reference.light, hues.chroma / reference.chroma,
                Decibels(frames, of_method));
    std::fflush(stdout);
  };
  std::printf(
      "| %s: %.1f %% at 0 or 255, hue spread %.3f | hue spread | of each frame | without "
      "dark | chroma | dB |\n|---|---|---|---|---|---|\n",
      styles[0].c_str(), 100 * clipped / pixels, reference.all);
  row("2D method", of_method);

  const std::vector<Image> renders = RendersOf(source.field, cameras);
  LeastSquaresAccumulator accumulator;
  for (size_t i = 0; i < renders.size(); ++i)
    for (int64_t k = 0; k < renders[i].num_pixels(); ++k)
      accumulator.Add(ColorAt(renders[i], k), ColorAt(of_method[i], k));
  const ColorMap map = accumulator.Solve();
  std::vector<Image> mapped = renders, missing = of_method;
  for (size_t i = 0; i < renders.size(); ++i)
    for (int64_t k = 0; k < renders[i].num_pixels(); ++k) {
      const Vec3d color = map(ColorAt(renders[i], k));
      for (int c = 0; c < 3; ++c)
        mapped[i].pixels[static_cast<size_t>(3 * k + c)] = static_cast<float>(color[c]);
    }
  row("linear map, on pixels", mapped);
  RadianceField of_map = source.field;
  of_map.appearance = ApplyColorMap(of_map.appearance, map);
  of_map.background = MapBackground(map, of_map.background);
  const std::vector<Image> map_renders = RendersOf(of_map, cameras);
  row("linear map, in the field", map_renders);
  for (size_t i = 0; i < missing.size(); ++i)
    for (size_t k = 0; k < missing[i].pixels.size(); ++k)
      missing[i].pixels[k] -= map_renders[i].pixels[k];
  for (const int harmonics : {1, 9}) {
    if (quick) continue;
    row(harmonics == 1 ? "ceiling of one colour a voxel" : "ceiling",
        RendersOf(FitCoefficients(of_map, cameras, missing, {.harmonics = harmonics}),
                  cameras));
  }
  for (const std::string& style : styles) {
    const StoredNetwork network = ReadNetworkFile(out + "/styles/" + style + "/network.npz");
    row("map of " + style, RendersOf(StyledFieldOf(source,
                                                   {NetworkOfMap(network.network.data().base),
                                                    network.k_est, network.background},
                                                   1, nullptr)
                                         .field,
                                     cameras));
    row("network " + style +
            Format(", bound %.2f K_est", network.network.Bound() / network.k_est),
        RendersOf(ReadStyledField(out, out + "/styles/" + style, 1).field, cameras));
  }
  return 0;
}

}  // namespace
}  // namespace regrade

int main(int argc, char** argv) {
  const bool quick = argc > 1 && std::string(argv[1]) == "--quick";
  if (argc < 3 + quick) {
    std::fprintf(stderr, "usage: hue_benchmark [--quick] OUT STYLE [STYLE...]\n");
    return 2;
  }
  try {
    return regrade::Run(quick, argv[1 + quick],
                        std::vector<std::string>(argv + 2 + quick, argv + argc));
  } catch (const regrade::Error& error) {
    std::fprintf(stderr, "hue_benchmark: %s\n", error.what());
    return 1;
  }
}
