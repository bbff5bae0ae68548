// compare_poses SPARSE TRUTH PHOTOS: prints the errors of a COLMAP model's poses.
//
// TRUTH is a transforms.json (OpenGL axes), or a folder of Strecha's NAME.camera files. PHOTOS
// is the folder that was posed: its k-th picture in the order of names is "0000k.png" in the
// model; models with the original names work as well. The two worlds are aligned by the
// similarity that fits the camera centres best (Umeyama, 1991). Printed are the angles between
// the rotations, and the distances between the centres as a fraction of the largest distance
// between two cameras.
#include <Eigen/Dense>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "kernels/base/error.h"
#include "reconstruct/colmap/colmap_model.h"

namespace fs = std::filesystem;
using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

struct Pose {
  Matrix3d world_from_camera;  // OpenCV axes
  Vector3d center;
};
using Poses = std::map<std::string, Pose>;  // by the picture's file name

Poses ReadTransformsJson(const std::string& path) {
  const nlohmann::json json = nlohmann::json::parse(std::ifstream(path));
  Poses poses;
  for (const auto& frame : json.at("frames")) {
    Pose pose;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j)
        pose.world_from_camera(i, j) =
            frame.at("transform_matrix").at(i).at(j).get<double>() * (j == 0 ? 1 : -1);
      pose.center[i] = frame.at("transform_matrix").at(i).at(3).get<double>();
    }
    poses[fs::path(frame.at("file_path").get<std::string>()).filename()] = pose;
  }
  return poses;
}

// K (9 numbers), 3 zeros, R (9 numbers: world from camera), centre, picture size.
Poses ReadStrecha(const std::string& folder) {
  Poses poses;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() != ".camera") continue;
    std::ifstream file(entry.path());
    double skipped;
    for (int i = 0; i < 12; ++i) file >> skipped;
    Pose pose;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) file >> pose.world_from_camera(i, j);
    for (int i = 0; i < 3; ++i) file >> pose.center[i];
    if (file) poses[entry.path().stem()] = pose;
  }
  return poses;
}

Poses ReadModel(const std::string& sparse, const std::string& photos) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(photos)) {
    const std::string type = entry.path().extension();
    if (type != ".txt" && type != ".TXT") names.push_back(entry.path().filename());
  }
  std::sort(names.begin(), names.end());
  Poses poses;
  for (const regrade::ColmapImage& image : regrade::ReadColmapModel(sparse).images) {
    std::string name = image.name;
    const bool staged = std::find(names.begin(), names.end(), name) == names.end();
    if (staged) name = names.at(std::stoul(image.name));
    const regrade::RigidTransform pose = image.camera_from_world.Inverse();
    Pose& result = poses[name];
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) result.world_from_camera(i, j) = pose.rotation(i, j);
      result.center[i] = pose.translation[i];
    }
  }
  return poses;
}

void PrintMedianAndMax(const char* what, std::vector<double> values) {
  std::sort(values.begin(), values.end());
  std::printf("%s: median %.4f, largest %.4f\n", what, values[values.size() / 2],
              values.back());
}

int Compare(const std::string& sparse, const std::string& truth_path,
            const std::string& photos) {
  const Poses model = ReadModel(sparse, photos);
  const Poses truth =
      fs::is_directory(truth_path) ? ReadStrecha(truth_path) : ReadTransformsJson(truth_path);
  std::vector<std::pair<Pose, Pose>> pairs;
  for (const auto& [name, pose] : model)
    if (truth.count(name) > 0) pairs.push_back({pose, truth.at(name)});
  std::printf("%zu poses in the model, %zu in the truth, %zu in both\n", model.size(),
              truth.size(), pairs.size());
  if (pairs.size() < 3) return 3;

  Eigen::Matrix3Xd from(3, pairs.size()), to(3, pairs.size());
  for (size_t i = 0; i < pairs.size(); ++i) {
    from.col(i) = pairs[i].first.center;
    to.col(i) = pairs[i].second.center;
  }
  const Eigen::Matrix4d similarity = Eigen::umeyama(from, to, true);
  const double scale = std::cbrt(similarity.topLeftCorner<3, 3>().determinant());
  const Matrix3d rotation = similarity.topLeftCorner<3, 3>() / scale;
  double extent = 0;
  for (Eigen::Index i = 0; i < to.cols(); ++i)
    for (Eigen::Index j = 0; j < i; ++j)
      extent = std::max(extent, (to.col(i) - to.col(j)).norm());
  std::vector<double> angles, distances;
  for (const auto& [mine, theirs] : pairs) {
    const Matrix3d difference =
        (rotation * mine.world_from_camera).transpose() * theirs.world_from_camera;
    angles.push_back(std::abs(Eigen::AngleAxisd(difference).angle()) * 180 / M_PI);
    const Vector3d center =
        similarity.topLeftCorner<3, 3>() * mine.center + similarity.topRightCorner<3, 1>();
    distances.push_back(100 * (center - theirs.center).norm() / extent);
  }
  PrintMedianAndMax("rotation error, degrees", angles);
  PrintMedianAndMax("position error, % of the camera extent", distances);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: compare_poses SPARSE TRUTH PHOTOS\n");
    return 2;
  }
  try {
    return Compare(argv[1], argv[2], argv[3]);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 3;
  }
}
