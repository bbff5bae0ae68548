#include "pipeline/photo_gains.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "kernels/scene/srgb.h"

namespace regrade {
namespace {

JsonValue Triple(const Vec3d& v) { return JsonValue::Array{v.x, v.y, v.z}; }

}  // namespace

void UndoGain(const Vec3d& gain, Image* photo) {
  if (gain == kAsTaken) return;
  for (size_t i = 0; i < photo->pixels.size(); ++i) {
    float& value = photo->pixels[i];
    const double light = LinearFromSrgb(value) / gain[static_cast<int>(i % 3)];
    value = static_cast<float>(SrgbFromLinear(std::min(1.0, light)));
  }
}

JsonValue GainsRecord(const Capture& capture, const ExposureEstimate& estimate) {
  JsonValue::Array rows;
  for (size_t v = 0; v < capture.views.size(); ++v) {
    const PhotoExposure& photo = estimate.photos[v];
    rows.push_back(JsonValue::Object{{"file", capture.views[v].file},
                                     {"gain", Triple(photo.gain)},
                                     {"log_error", Triple(photo.log_error)},
                                     {"observations", photo.observations}});
  }
  return rows;
}

JsonValue RecordedGainRows(const Workspace& workspace) {
  const auto record = workspace.Find("reconstruct");
  const JsonValue* const rows = record ? record->figures.Find("exposure") : nullptr;
  return rows ? *rows : JsonValue();
}

PhotoGains RecordedGains(const Workspace& workspace, const Capture& capture) {
  const JsonValue rows = RecordedGainRows(workspace);
  PhotoGains gains;
  if (rows.IsNull()) return gains;
  bool fits = rows.AsArray().size() == capture.views.size();
  for (size_t v = 0; fits && v < capture.views.size(); ++v) {
    const JsonValue& row = rows.AsArray()[v];
    const JsonValue::Array& gain = row.At("gain").AsArray();
    fits = row.At("file").AsString() == capture.views[v].file && gain.size() == 3 &&
           std::all_of(gain.begin(), gain.end(),
                       [](const JsonValue& value) { return value.AsDouble() > 0; });
    if (fits)
      gains.of_view.push_back({gain[0].AsDouble(), gain[1].AsDouble(), gain[2].AsDouble()});
  }
  if (!fits)
    throw Error(ExitCode::kInput, "the recorded exposures are not those of its photos",
                workspace.folder(), "use --restart-from reconstruct");
  return gains;
}

}  // namespace regrade
