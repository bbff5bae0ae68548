#include "pipeline/commands/export_lut.h"

#include <algorithm>
#include <filesystem>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/image/decibels.h"
#include "pipeline/commands/compared_renders.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/images/cube_file.h"
#include "pipeline/run/run_file.h"
#include "pipeline/stages/styled_field.h"
#include "pipeline/workspace/output_names.h"
#include "pipeline/workspace/style_folders.h"
#include "stylize/fit_color_table.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

// The map of a retouch that is one map of colours, at the style's strength; size 0 for others.
ColorTable OwnMapOf(const std::string& style) {
  if (!fs::exists(style + "/" + kRetouchRecord) || fs::exists(style + "/layers")) return {};
  const ColorLut lut = ReadCubeFile(style + "/" + kEditLut);
  const RunFile run = ReadRunFile(style + "/run.json");
  const JsonValue* value = run.options.Find("strength");
  const double strength = value != nullptr ? value->AsDouble() : 1;
  return TabulateColors(lut.table.size,
                        [&](const Vec3d& c) { return c * (1 - strength) + lut(c) * strength; });
}

}  // namespace

void ExportLut(const ExportOptions& options, const std::string& folder, Console* console) {
  constexpr int kViews = 12, kSize = 33, kStride = 4;  // of pixels
  if (options.names.size() > 1)
    throw UsageError("a LUT is one style", "--name", "write one at a time");
  const std::string name =
      ChosenStyle(folder, options.names.empty() ? "" : options.names.front());
  const std::string style = StyleFolder(folder, name);
  const ColorTable own = OwnMapOf(style);
  if (own.size == 0) ChosenLearnedStyle(folder, name);
  if (!IsCubeFile(options.out))
    throw UsageError("'" + options.out + "' is no LUT", "--out", "name it LOOK.cube");
  if (options.dry_run) {
    console->Info(Concat("style ", name, " would be written to ", options.out, " as a LUT of ",
                         kSize, "^3 colours"));
    return;
  }
  if (own.size > 0) {
    WriteFileAtomically(options.out, CubeText(own, name));
    return console->Info(Format(
        "wrote %s: the edit's own map of colours as a LUT of %d^3 colours, which magnifies "
        "differences at most %.2f times",
        options.out.c_str(), own.size, SteepestSlope(own)));
  }
  CheckResults(folder, {name});
  const StoredField stored = ReadFieldFile(folder + "/field.npz");
  const std::vector<Camera> cameras = ViewsOf(folder, stored, kViews);
  const std::vector<Image> before = RendersOf(stored.field, cameras),
                           after = RendersOf(ReadStyledField(folder, style).field, cameras);
  // It is measured on views that it is not fitted to.
  const auto color = [](const Image& image, int64_t i) {
    Vec3d c;
    for (int k = 0; k < 3; ++k)
      c[k] = std::clamp(double{image.pixels[static_cast<size_t>(3 * i + k)]}, 0.0, 1.0);
    return c;
  };
  TableFit fit(kSize);
  for (size_t v = 0; v<before.size(); v += before.size()> 1 ? 2 : 1)
    for (int64_t i = 0; i < before[v].num_pixels(); i += kStride)
      fit.Add(color(before[v], i), color(after[v], i));
  const ColorTable table = fit.Solve();
  WriteFileAtomically(options.out, CubeText(table, name));
  double sum = 0, count = 0;
  for (size_t v = before.size() > 1 ? 1 : 0; v < before.size(); v += 2)
    for (int64_t i = 0; i < before[v].num_pixels(); ++i, count += 3) {
      const Vec3d d = table(color(before[v], i)) - color(after[v], i);
      sum += Dot(d, d);
    }
  console->Info(Format(
      "wrote %s: style %s as a LUT of %d^3 colours; on renders it is %.1f dB from the styled "
      "scene, which may differ from place to place, and magnifies differences at most %.2f "
      "times",
      options.out.c_str(), name.c_str(), kSize, Decibels(sum / std::max(count, 1.0)),
      SteepestSlope(table)));
}

}  // namespace regrade
