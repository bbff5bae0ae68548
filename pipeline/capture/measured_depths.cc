#include "pipeline/capture/measured_depths.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/base/quantile.h"
#include "pipeline/capture/photo_names.h"
#include "pipeline/files/json_file.h"
#include "pipeline/files/text.h"
#include "pipeline/images/image_file.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr char kUnitFile[] = "unit.json";
constexpr double kPointsOfMap = 20000;
constexpr double kJump = 0.05;         // between neighbours, of the depth
constexpr double kAgreement = 0.1;     // of a depth
constexpr size_t kEnoughToJudge = 10;  // points of a photo
constexpr double kUnchecked = 0.02;    // relative error of maps without points
constexpr double kSameUnit = 0.05;

fs::path StagedDepthOf(const std::string& photo_path) {
  const fs::path path(photo_path);
  return path.parent_path().parent_path() / "depths" / path.filename();
}

// A view's map, in world units.
struct DepthMap {
  Image z;
  std::vector<double> ratios;  // to the depths of points
  bool wrong = false;

  // 0 beyond the map.
  float At(int x, int y) const {
    return x >= 0 && y >= 0 && x < z.width && y < z.height ? z.at(x, y)[0] : 0.0f;
  }
};

double UnitOf(const fs::path& folder) {
  const std::string path = (folder / kUnitFile).string();
  const JsonValue file = ReadJsonFile(path);
  const JsonValue* unit = file.Find("unit");
  if (unit == nullptr || !unit->IsNumber() || !(unit->AsDouble() > 0))
    throw InputError("holds no unit of depths", path, "find the poses again");
  return unit->AsDouble();
}

// A map that a photo comes with, as it is stored. Throws Error(kInput).
Image ReadMap(const std::string& path, const StagedPhoto& photo) {
  const int bits = DecodePhoto(path, {.min_side = 1}).bits;
  Image map = ReadGivenImage(path);
  if (map.channels != 1 || bits != 16)
    throw InputError("has not one channel of 16 bits, as depths have", path,
                     "write millimetres as 16-bit PNG, 0 where nothing was measured");
  CheckAspect(map, photo.width, photo.height, path, ExitCode::kInput);
  return map;
}

DepthMap ReadStaged(const CaptureView& view) {
  const fs::path path = StagedDepthOf(view.path);
  DepthMap map;
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return map;
  const double unit = UnitOf(path.parent_path());
  map.z = ReadImage(path.string());
  for (float& z : map.z.pixels) z = static_cast<float>(unit * std::round(65535 * double{z}));
  return map;
}

void CompareWithPoints(const Capture& capture, const std::vector<int>& views,
                       std::vector<DepthMap>* maps) {
  std::vector<int> place(capture.views.size(), -1);
  for (size_t k = 0; k < views.size(); ++k)
    place[static_cast<size_t>(views[k])] = static_cast<int>(k);
  for (const ScenePoint& point : capture.points)
    for (const int32_t v : point.views) {
      const int k = place[static_cast<size_t>(v)];
      if (k < 0 || (*maps)[static_cast<size_t>(k)].z.empty()) continue;
      DepthMap& map = (*maps)[static_cast<size_t>(k)];
      const Camera& camera = capture.views[static_cast<size_t>(v)].camera;
      double x, y, depth;
      if (!camera.Project(point.position, &x, &y, &depth)) continue;
      const float measured =
          map.At(static_cast<int>(std::floor(x * map.z.width / camera.width)),
                 static_cast<int>(std::floor(y * map.z.height / camera.height)));
      if (measured > 0) map.ratios.push_back(double{measured} / depth);
    }
}

struct Agreement {
  double unit = 1;            // measured over the points' depths
  double error = kUnchecked;  // relative
};

// Marks wrong maps.
Agreement Judge(std::vector<DepthMap>* maps) {
  Agreement found;
  std::vector<double> all;
  for (const DepthMap& map : *maps) all.insert(all.end(), map.ratios.begin(), map.ratios.end());
  if (all.size() < kEnoughToJudge) return found;
  found.unit = Median(all);
  std::vector<double> errors;
  for (DepthMap& map : *maps) {
    size_t agree = 0;
    for (double& ratio : map.ratios) {
      ratio = std::abs(ratio / found.unit - 1);
      agree += ratio < kAgreement;
    }
    map.wrong = map.ratios.size() >= kEnoughToJudge && 2 * agree < map.ratios.size();
    if (!map.wrong) errors.insert(errors.end(), map.ratios.begin(), map.ratios.end());
  }
  constexpr double kSigmaOfMedian = 1.4826;  // of a normal distribution
  if (!errors.empty()) found.error = kSigmaOfMedian * Median(errors);
  return found;
}

void AddPoints(const DepthMap& map, const Camera& camera, const Agreement& found,
               const Similarity& field_from_world, std::vector<SeenPoint>* points) {
  const int step = std::max(
      1, static_cast<int>(std::sqrt(static_cast<double>(map.z.num_pixels()) / kPointsOfMap)));
  const RigidTransform world_from_camera = camera.camera_from_world.Inverse();
  for (int y = step / 2; y < map.z.height; y += step)
    for (int x = step / 2; x < map.z.width; x += step) {
      if (!IsOneSurface(map.z, x, y)) continue;
      const double depth = double{map.At(x, y)} / found.unit;
      const Vec3d ray = camera.CameraRay((x + 0.5) * camera.width / map.z.width,
                                         (y + 0.5) * camera.height / map.z.height);
      if (!(ray.z > 0)) continue;
      const Vec3d place = world_from_camera * (ray * (depth / ray.z));
      points->push_back({(field_from_world * place).Cast<float>(),
                         static_cast<float>(field_from_world.scale * found.error * depth)});
    }
}

}  // namespace

bool IsOneSurface(const Image& z, int x, int y) {
  if (x < 1 || y < 1 || x + 1 >= z.width || y + 1 >= z.height) return false;
  const float here = *z.at(x, y);
  for (const float* const there :
       {z.at(x - 1, y), z.at(x + 1, y), z.at(x, y - 1), z.at(x, y + 1)})
    if (!(std::abs(*there - here) < static_cast<float>(kJump) * here)) return false;
  return true;
}

int StageDepths(const std::vector<std::string>& maps, const std::vector<StagedPhoto>& photos,
                double unit, const std::string& folder, std::vector<std::string>* notes) {
  REGRADE_CHECK_EQ(maps.size(), photos.size());
  fs::remove_all(folder);  // of an earlier run
  int count = 0;
  std::vector<std::string> left;
  for (size_t i = 0; i < photos.size(); ++i) {
    if (maps[i].empty()) continue;
    try {
      const Image map = ReadMap(maps[i], photos[i]);
      fs::create_directories(folder);
      WritePng16(folder + "/" + photos[i].name, map);
      ++count;
    } catch (const Error& error) {
      if (error.code() != ExitCode::kInput) throw;
      left.push_back(fs::path(maps[i]).filename().string() + " " + error.what());
    }
  }
  if (count > 0) WriteJsonFile(folder + "/" + kUnitFile, JsonValue::Object{{"unit", unit}});
  if (count > 0)
    notes->push_back(Counted(count, "map") +
                     " of measured depths: the fit takes them as points");
  if (!left.empty())
    notes->push_back(Counted(std::ssize(left), "depth map") + " left out: " + left[0] +
                     (left.size() > 1 ? ", and so on" : ""));
  return count;
}

void FindStagedDepths(const std::string& folder, std::map<std::string, std::string>* maps,
                      double* unit) {
  std::error_code error;
  if (!fs::is_regular_file(fs::path(folder) / kUnitFile, error)) return;
  *unit = UnitOf(folder);
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error))
    if (it->path().extension() == ".png")
      (*maps)[it->path().filename().string()] = it->path().string();
}

std::vector<std::vector<SeenPoint>> PointsOfViews(const Capture& capture,
                                                  const std::vector<int>& views,
                                                  const Similarity& field_from_world,
                                                  std::vector<std::string>* notes) {
  std::vector<std::vector<SeenPoint>> seen = PointsSeenBy(capture, views, field_from_world);
  std::vector<DepthMap> maps;
  for (const int v : views) maps.push_back(ReadStaged(capture.views[static_cast<size_t>(v)]));
  const int64_t there =
      std::ranges::count_if(maps, [](const DepthMap& map) { return !map.z.empty(); });
  if (there == 0) return seen;
  CompareWithPoints(capture, views, &maps);
  const Agreement found = Judge(&maps);
  std::vector<std::string> wrong;
  for (size_t k = 0; k < views.size(); ++k) {
    const CaptureView& view = capture.views[static_cast<size_t>(views[k])];
    if (maps[k].wrong)
      wrong.push_back(view.file);
    else if (!maps[k].z.empty())
      AddPoints(maps[k], view.camera, found, field_from_world, &seen[k]);
  }
  std::string note = Concat("measured depths of ", Counted(there, "photo"),
                            Format(", with an error of %.1f %%", 100 * found.error));
  if (std::abs(std::log(found.unit)) > kSameUnit)
    note += Format("; they are %.4g times those of the points, and are scaled", found.unit);
  if (!wrong.empty())
    note += "; left out, because the photo's points disagree: " + Join(wrong, ", ");
  notes->push_back(note);
  return seen;
}

}  // namespace regrade
