#include "pipeline/page/keyframes.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/scene/facing.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/workspace/stage_record.h"

namespace regrade {
namespace {

constexpr char kFormat[] = "regrade camera path";
constexpr int kVersion = 1;
constexpr char kRemedy[] = "save the path again with the page's button Save camera_path.json";
constexpr uint64_t kMostBytes = 4 << 20;
constexpr double kFarthest = 1e6;   // of the field's frame, whose box has sides of about 2
constexpr double kParallel = 1e-6;  // sine of an angle
constexpr double kSumSlack = 1e-6;  // weights are written with eight digits

[[noreturn]] void Refuse(const std::string& why, const JsonValue& value,
                         const std::string& where) {
  throw InputError(why, value.line() > 0 ? Concat(where, ":", value.line()) : where, kRemedy);
}

double NumberIn(const JsonValue& value, double least, double most, const std::string& where) {
  const double number = value.AsDouble();
  if (!(number >= least && number <= most))
    Refuse(Format("a number that is not between %g and %g", least, most), value, where);
  return number;
}

Vec3d PointOf(const JsonValue& value, const std::string& where) {
  const JsonValue::Array& numbers = value.AsArray();
  if (numbers.size() != 3) Refuse("a place or direction needs three numbers", value, where);
  Vec3d point;
  for (int a = 0; a < 3; ++a)
    point[a] = NumberIn(numbers[static_cast<size_t>(a)], -kFarthest, kFarthest, where);
  return point;
}

// As web/camera.js: the zero vector stays what it is.
Vec3d Unit(const Vec3d& v) {
  const double length = Norm(v);
  return v / (length > 0 ? length : 1);
}

std::vector<double> WeightsOf(const JsonValue& value, size_t styles, const std::string& where) {
  std::vector<double> weights;
  double sum = 0;
  for (const JsonValue& weight : value.AsArray()) {
    weights.push_back(NumberIn(weight, 0, 1, where));
    sum += weights.back();
  }
  if (weights.size() != styles)
    Refuse(Concat("a keyframe has ", weights.size(), " weights for ", styles, " styles"), value,
           where);
  if (sum > 1 + kSumSlack)
    Refuse("the weights of a keyframe add up to more than 1", value, where);
  if (sum > 1)
    for (double& weight : weights) weight /= sum;
  return weights;
}

Keyframe KeyframeOf(const JsonValue& value, size_t styles, const std::string& where) {
  Keyframe key;
  key.time = NumberIn(value.At("time"), 0, kLongestPath, where);
  key.eye = PointOf(value.At("eye"), where);
  key.forward = Unit(PointOf(value.At("forward"), where));
  key.up = Unit(PointOf(value.At("up"), where));
  if (!(Norm(Cross(key.forward, key.up)) > kParallel))
    Refuse("a keyframe's directions forward and up are zero or parallel", value, where);
  key.half[0] = NumberIn(value.At("half_width"), 1e-3, 1e3, where);
  key.half[1] = NumberIn(value.At("half_height"), 1e-3, 1e3, where);
  key.weights = WeightsOf(value.At("weights"), styles, where);
  return key;
}

Vec3d Spline(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d, double t) {
  Vec3d p;
  for (int i = 0; i < 3; ++i)
    p[i] = b[i] + 0.5 * t *
                      (c[i] - a[i] +
                       t * (2 * a[i] - 5 * b[i] + 4 * c[i] - d[i] +
                            t * (3 * (b[i] - c[i]) + d[i] - a[i])));
  return p;
}

KeyframePath PathOf(const JsonValue& json, const std::string& where) {
  const JsonValue *format = json.Find("format"), *version = json.Find("version");
  if (format == nullptr || !(*format == JsonValue(kFormat)))
    throw InputError("is no camera path of a page", where, kRemedy);
  if (version == nullptr || !(*version == JsonValue(kVersion)))
    throw InputError("is a camera path of another version of regrade", where,
                     "save the path again with a page of this version");
  KeyframePath path;
  for (const JsonValue& style : json.At("styles").AsArray()) {
    path.styles.push_back(style.AsString());
    if (path.styles.size() > kMostPathStyles) Refuse("more than 16 styles", style, where);
  }
  if (const JsonValue* fps = json.Find("frames_per_second"))
    path.fps = NumberIn(*fps, 1, 240, where);
  const JsonValue::Array& keyframes = json.At("keyframes").AsArray();
  if (keyframes.empty() || keyframes.size() > kMostKeyframes)
    Refuse(Concat("has ", keyframes.size(), " keyframes, and 1 to ", kMostKeyframes,
                  " are possible"),
           json, where);
  for (const JsonValue& value : keyframes) {
    Keyframe key = KeyframeOf(value, path.styles.size(), where);
    if (!path.keyframes.empty() && !(key.time > path.keyframes.back().time))
      Refuse("the keyframes' times do not rise", value, where);
    path.keyframes.push_back(std::move(key));
  }
  return path;
}

}  // namespace

Keyframe KeyframePath::At(double seconds) const {
  const size_t last = keyframes.size() - 1;
  size_t i = 0;
  while (i + 1 < last && keyframes[i + 1].time <= seconds) ++i;
  const size_t j = std::min(i + 1, last);
  const Keyframe &a = keyframes[i > 0 ? i - 1 : 0], &b = keyframes[i], &c = keyframes[j],
                 &d = keyframes[std::min(j + 1, last)];
  const double length = c.time - b.time;
  const double t = length > 0 ? std::clamp((seconds - b.time) / length, 0.0, 1.0) : 0;
  Keyframe key;
  key.time = seconds;
  key.eye = Spline(a.eye, b.eye, c.eye, d.eye, t);
  key.forward = Unit(Spline(a.forward, b.forward, c.forward, d.forward, t));
  key.up = Unit(Spline(a.up, b.up, c.up, d.up, t));
  if (!(Norm(Cross(key.forward, key.up)) > kParallel)) key.forward = b.forward, key.up = b.up;
  for (int k = 0; k < 2; ++k) key.half[k] = (1 - t) * b.half[k] + t * c.half[k];
  for (size_t k = 0; k < b.weights.size(); ++k)
    key.weights.push_back((1 - t) * b.weights[k] + t * c.weights[k]);
  return key;
}

KeyframePath ParseKeyframePath(std::string_view text, const std::string& where) {
  try {
    return PathOf(ParseJson(text, where), where);
  } catch (const Error& error) {
    if (!error.hint().empty()) throw;
    throw InputError(error.what_failed(), error.where().empty() ? where : error.where(),
                     kRemedy);
  }
}

KeyframePath ReadKeyframePath(const std::string& path) {
  return ParseKeyframePath(ReadWholeFile(path, kMostBytes), path);
}

Camera CameraOfKeyframe(const Keyframe& key, int width, int height, const NdcSpace& ndc) {
  Camera camera;
  camera.width = width, camera.height = height;
  const double wide = width / (2 * key.half[0]), high = height / (2 * key.half[1]);
  camera.fx = camera.fy = std::sqrt(wide * high);
  camera.cx = width / 2.0, camera.cy = height / 2.0;
  const Vec3d side = Unit(Cross(key.forward, key.up));
  camera.camera_from_world = Facing(key.eye, key.forward, side);
  camera.ndc = ndc;
  return camera;
}

std::string PageStyleId(const std::string& style_folder) {
  return HashFile(style_folder + "/network.npz").substr(0, 16);
}

}  // namespace regrade
