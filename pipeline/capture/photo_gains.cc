#include "pipeline/capture/photo_gains.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/scene/srgb.h"

namespace regrade {
namespace {

constexpr int64_t kGainsSchema = 1;
constexpr double kNearlyClipped = 0.98;  // encoded

JsonValue Triple(const Vec3d& v) { return JsonValue::Array{v.x, v.y, v.z}; }

// Calls `change` with each value of an RGB picture, but NaN, and the factor of its light.
template <typename Change>
void ForEachValue(const PhotoGain& gain, Image* picture, const Change& change) {
  const bool even = gain.falloff == LensFalloff{};
#pragma omp parallel for schedule(static)
  for (int64_t p = 0; p < picture->num_pixels(); ++p) {
    const auto x = static_cast<double>(p % picture->width),
               y = static_cast<double>(p / picture->width);
    const double r2 = even ? 0 : Radius2(picture->width, picture->height, x + 0.5, y + 0.5);
    const Vec3d factors = even ? gain.light : gain.light * std::exp(gain.falloff.LogAt(r2));
    for (int c = 0; c < 3; ++c)
      if (float& value = picture->pixels[static_cast<size_t>(3 * p + c)]; !std::isnan(value))
        value = change(value, factors[c]);
  }
}

}  // namespace

PhotoGains GainsOf(const ExposureEstimate& estimate, const std::vector<Vec3d>& clipped) {
  PhotoGains gains;
  double of_dark = 0, of_bright = 0;
  int dark = 0, bright = 0;
  for (size_t v = 0; v < estimate.photos.size(); ++v)
    for (int c = 0; c < 3 && estimate.photos[v].known; ++c) {
      const bool is_dark = estimate.photos[v].gain[c] < 1;
      (is_dark ? of_dark : of_bright) += clipped[v][c];
      ++(is_dark ? dark : bright);
    }
  // Of means: there may be more photos of one kind.
  const double highlights =
      dark > 0 && of_bright > 0 ? std::min(1.0, of_dark / dark / (of_bright / bright)) : 0;
  for (const PhotoExposure& photo : estimate.photos)
    gains.of_view.push_back(photo.known ? PhotoGain{photo.gain, highlights} : kAsTaken);
  return gains;
}

void UndoGain(const PhotoGain& gain, Image* photo) {
  if (gain == kAsTaken) return;
  ForEachValue(gain, photo, [&gain](float value, double factor) {
    const double undone = SrgbFromLinear(std::min(1.0, LinearFromSrgb(value) / factor));
    // A reduced photo has values in between at the edge of what was clipped.
    const double t = std::clamp((value - kNearlyClipped) / (1 - kNearlyClipped), 0.0, 1.0);
    const double up = factor > 1 ? gain.highlights * t * t * (3 - 2 * t) : 0;
    return static_cast<float>(undone + up * (1 - undone));
  });
}

void PutGain(const PhotoGain& gain, Image* picture) {
  if (gain == kAsTaken) return;
  ForEachValue(gain, picture, [](float value, double factor) {
    const double light = LinearFromSrgb(std::clamp(value, 0.0f, 1.0f)) * factor;
    return static_cast<float>(SrgbFromLinear(std::min(1.0, light)));
  });
}

void WriteGains(const std::string& poses, const Capture& capture,
                const ExposureEstimate& estimate, const PhotoGains& gains) {
  const std::string path = poses + "/" + kExposureFile;
  if (gains.of_view.empty()) {
    std::filesystem::remove(path);
    return;
  }
  JsonValue::Array rows;
  for (size_t v = 0; v < capture.views.size(); ++v) {
    const PhotoExposure photo = estimate.photos.empty() ? PhotoExposure() : estimate.photos[v];
    const PhotoGain gain = gains.Of(static_cast<int>(v));
    JsonValue row = JsonValue::Object{{"file", capture.views[v].file},
                                      {"gain", Triple(gain.light)},
                                      {"highlights", gain.highlights},
                                      {"log_error", Triple(photo.log_error)},
                                      {"observations", photo.observations}};
    if (gain.falloff != LensFalloff{})
      row["falloff"] = JsonValue::Array{gain.falloff.a, gain.falloff.b};
    rows.push_back(std::move(row));
  }
  WriteJsonFile(path, JsonValue::Object{{"schema", kGainsSchema}, {"photos", std::move(rows)}});
}

JsonValue StoredGainRows(const std::string& poses) {
  const std::string path = poses + "/" + kExposureFile;
  if (!std::filesystem::exists(path)) return JsonValue();
  const JsonValue file = ReadJsonFile(path);
  const JsonValue* const schema = file.IsObject() ? file.Find("schema") : nullptr;
  if (schema == nullptr || !(*schema == JsonValue(kGainsSchema)))
    throw InputError("is not of schema " + std::to_string(kGainsSchema), path,
                     "use --restart-from reconstruct");
  return file.At("photos");
}

PhotoGains ReadGains(const std::string& poses, const Capture& capture) {
  const JsonValue rows = StoredGainRows(poses);
  PhotoGains gains;
  if (rows.IsNull()) return gains;
  bool fits = rows.AsArray().size() == capture.views.size();
  for (size_t v = 0; fits && v < capture.views.size(); ++v) {
    const JsonValue& row = rows.AsArray()[v];
    const JsonValue::Array& gain = row.At("gain").AsArray();
    fits =
        row.At("file").AsString() == capture.views[v].file && gain.size() == 3 &&
        std::ranges::all_of(gain, [](const JsonValue& value) { return value.AsDouble() > 0; });
    if (!fits) break;
    PhotoGain of_view{{gain[0].AsDouble(), gain[1].AsDouble(), gain[2].AsDouble()},
                      row.At("highlights").AsDouble()};
    if (const JsonValue* const falloff = row.Find("falloff")) {
      const JsonValue::Array& ab = falloff->AsArray();
      fits = ab.size() == 2;
      if (fits) of_view.falloff = {ab[0].AsDouble(), ab[1].AsDouble()};
    }
    gains.of_view.push_back(of_view);
  }
  if (!fits)
    throw InputError("the stored exposures are not those of its photos",
                     poses + "/" + kExposureFile, "use --restart-from reconstruct");
  return gains;
}

}  // namespace regrade
