// regrade_gpu render: frames of a field at a packed capture's held-out cameras, and what they
// cost.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/field/cuda/device_rays.h"
#include "kernels/field/field_kind.h"
#include "kernels/field/packed_grid.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/gpu/gpu_commands.h"

namespace regrade {

void WritePpm(const std::string& path, const Image& image) {
  std::ofstream file(path, std::ios::binary);
  file << "P6\n" << image.width << " " << image.height << "\n255\n";
  for (const float value : image.pixels)
    file.put(static_cast<char>(std::lround(255 * std::clamp(value, 0.0f, 1.0f))));
  if (!file) throw ResourceError("cannot be written", path, "is the disk full?");
}

PackedCapture ReadCaptureFor(const RadianceField& field, const std::string& path) {
  PackedCapture capture = ReadPackedCapture(path);
  if (!KindOf(*field.geometry).lenses)
    for (PackedView& view : capture.views) view = PinholeView(std::move(view));
  return capture;
}

void RenderHeldOut(const FieldRenderer& renderer, const PackedCapture& capture,
                   const std::string& folder, const std::string& name) {
  std::filesystem::create_directories(folder);
  int index = 0;
  for (const PackedView& view : capture.views)
    if (view.held_out)
      WritePpm(Concat(folder, "/", name, "_", index++, ".ppm"),
               renderer.Render(view.camera).color);
}

void RenderPacked(const RenderPackedOptions& settings) {
  const RadianceField field = ReadFieldFile(settings.field).field;
  const PackedCapture capture = ReadCaptureFor(field, settings.capture);
  if (!settings.frames.empty() && !settings.compare)
    RenderHeldOut(FieldRenderer(field, Backend::kCuda), capture, settings.frames, "frame");
  JsonValue record =
      JsonValue::Object{{"capture", settings.capture},
                        {"device", ReadDeviceStatus().name},
                        {KindOf(*field.geometry).name, field.geometry->num_voxels()}};
  if (settings.compare)
    record["compare"] =
        CompareRenderers(UploadGrid(MakeFastGrid(field)), capture, field.march.step, settings);
  else
    record["render"] = RenderCosts(field, capture);
  std::printf("%s\n", DumpJson(record, -1).c_str());
  std::fflush(stdout);
}

}  // namespace regrade
