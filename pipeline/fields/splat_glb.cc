#include "pipeline/fields/splat_glb.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/splats/covariance.h"
#include "pipeline/fields/placed_splats.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/byte_packing.h"
#include "pipeline/files/json_file.h"

namespace regrade {
namespace {

constexpr char kExtension[] = "KHR_gaussian_splatting";
constexpr int kFloat = 5126, kByte = 5121, kArrayBuffer = 34962, kPoints = 0;

// The buffer of a file, and its description in JSON.
class GlbBuffer {
 public:
  // `values` [N, components]; those of the type float, or bytes that mean [0, 1].
  template <typename T>
  JsonValue& Add(const std::string& name, const char* type, int64_t count,
                 const std::vector<T>& values) {
    constexpr bool kBytes = sizeof(T) == 1;
    attributes_.emplace_back(name, std::ssize(accessors_));
    views_.push_back(
        JsonValue::Object{{"buffer", 0},
                          {"byteOffset", static_cast<uint64_t>(bytes_.size())},
                          {"byteLength", static_cast<uint64_t>(sizeof(T) * values.size())},
                          {"target", kArrayBuffer}});
    JsonValue accessor = JsonValue::Object{{"bufferView", std::ssize(accessors_)},
                                           {"componentType", kBytes ? kByte : kFloat},
                                           {"count", count},
                                           {"type", type}};
    if (kBytes) accessor["normalized"] = true;
    bytes_.append(reinterpret_cast<const char*>(values.data()), sizeof(T) * values.size());
    accessors_.push_back(std::move(accessor));
    return accessors_.back();
  }

  std::string Json() const {
    const JsonValue kind = JsonValue::Object{{"kernel", "ellipse"},
                                             {"colorSpace", "srgb_rec709_display"},
                                             {"sortingMethod", "cameraDistance"},
                                             {"projection", "perspective"}};
    const JsonValue mesh =
        JsonValue::Object{{"attributes", attributes_},
                          {"mode", kPoints},
                          {"extensions", JsonValue::Object{{kExtension, kind}}}};
    const auto list = [](JsonValue::Object only) { return JsonValue::Array{std::move(only)}; };
    return DumpJson(
        JsonValue::Object{
            {"asset",
             JsonValue::Object{{"version", "2.0"}, {"generator", "regrade " REGRADE_VERSION}}},
            {"extensionsUsed", JsonValue::Array{kExtension}},
            {"scene", 0},
            {"scenes", list({{"nodes", JsonValue::Array{0}}})},
            {"nodes", list({{"mesh", 0}})},
            {"meshes", list({{"primitives", JsonValue::Array{mesh}}})},
            {"accessors", accessors_},
            {"bufferViews", views_},
            {"buffers", list({{"byteLength", static_cast<uint64_t>(bytes_.size())}})}},
        -1);
  }
  const std::string& bytes() const { return bytes_; }

 private:
  JsonValue::Object attributes_;
  JsonValue::Array views_, accessors_;
  std::string bytes_;
};

void AddPositions(const Splats& splats, GlbBuffer* buffer) {
  Vec3f low = splats.view()[0].mean, high = low;
  for (int64_t i = 0; i < splats.count(); ++i)
    for (int a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], splats.view()[i].mean[a]);
      high[a] = std::max(high[a], splats.view()[i].mean[a]);
    }
  const auto list = [](const Vec3f& v) {
    return JsonValue::Array{double{v.x}, double{v.y}, double{v.z}};
  };
  JsonValue& accessor = buffer->Add("POSITION", "VEC3", splats.count(), splats.mean);
  accessor["min"] = list(low);
  accessor["max"] = list(high);
}

void AddShapes(const Splats& splats, const std::string& prefix, GlbBuffer* buffer) {
  const int64_t count = splats.count();
  std::vector<float> rotations, scales;
  for (int64_t i = 0; i < count; ++i) {
    const Splat<float> splat = splats.view()[i];
    float unit[4];
    UnitQuaternion(splat.quaternion, unit);
    rotations.insert(rotations.end(), {unit[1], unit[2], unit[3], unit[0]});
    for (int a = 0; a < 3; ++a) scales.push_back(std::exp(splat.log_scale[a]));
  }
  buffer->Add(prefix + "ROTATION", "VEC4", count, rotations);
  buffer->Add(prefix + "SCALE", "VEC3", count, scales);
}

void AddColors(const Splats& splats, const std::string& prefix, GlbBuffer* buffer) {
  const int64_t count = splats.count();
  const SplatsView<float> view = splats.view();
  std::vector<float> opacities;
  std::vector<uint8_t> points;
  const auto add_byte = [&points](double share) {
    points.push_back(static_cast<uint8_t>(std::clamp(std::round(255 * share), 0.0, 255.0)));
  };
  for (int64_t i = 0; i < count; ++i) {
    const double opacity = 1 / (1 + std::exp(-double{view.opacity_logit[i]}));
    opacities.push_back(static_cast<float>(opacity));
    for (int c = 0; c < 3; ++c)
      add_byte(0.5 + kSh0 * double{view.Coefficients(i)[c * view.basis]});
    add_byte(opacity);
  }
  buffer->Add(prefix + "OPACITY", "SCALAR", count, opacities);
  buffer->Add("COLOR_0", "VEC4", count, points);
  for (int degree = 0; BasisOfDegree(degree) <= view.basis; ++degree)
    for (int n = 0; n < 2 * degree + 1; ++n) {
      std::vector<float> harmonic;
      for (int64_t i = 0; i < count; ++i)
        for (int c = 0; c < 3; ++c)
          harmonic.push_back(view.Coefficients(i)[c * view.basis + degree * degree + n]);
      buffer->Add(Concat(prefix, "SH_DEGREE_", degree, "_COEF_", n), "VEC3", count, harmonic);
    }
}

}  // namespace

void WriteSplatGlb(const std::string& path, Splats splats) {
  MoveSplats({1, HalfTurnAboutX(), {}}, &splats);
  const std::string prefix = std::string(kExtension) + ":";
  GlbBuffer buffer;
  AddPositions(splats, &buffer);
  AddShapes(splats, prefix, &buffer);
  AddColors(splats, prefix, &buffer);
  std::string json = buffer.Json();
  json.append((4 - json.size() % 4) % 4, ' ');
  const uint64_t size = 12 + 8 + json.size() + 8 + buffer.bytes().size();
  if (size > UINT32_MAX)
    throw UsageError(Concat(splats.count(), " splats need ", size, " bytes, and glTF has 4 GB"),
                     path, "use --format ply, spz or compressed-ply");
  BytePacker begin, middle;
  for (const uint64_t value : {uint64_t{0x46546c67}, uint64_t{2}, size, uint64_t{json.size()},
                               uint64_t{0x4e4f534a}})  // glTF, its version, JSON
    begin.Value(static_cast<uint32_t>(value));
  middle.Value(static_cast<uint32_t>(buffer.bytes().size()));
  middle.Value(uint32_t{0x004e4942});  // BIN
  const std::string head = begin.Joined(), between = middle.Joined();
  WriteFileAtomically(path, std::vector<std::string_view>{head, json, between, buffer.bytes()});
}

}  // namespace regrade
