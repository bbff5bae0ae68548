// Fuzz targets: poses_bounds.npy of LLFF captures, text files of NSVF's layout, cameras.npz of
// DTU.
#include <algorithm>
#include <cmath>

#include "pipeline/capture/dtu_cameras.h"
#include "pipeline/capture/llff_poses.h"
#include "pipeline/capture/nsvf_cameras.h"
#include "pipeline/files/npy_header.h"
#include "pipeline/files/npz_file.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/mutate.h"
#include "tests/fuzz/stored_zip.h"
#include "tests/support/small_archive.h"

namespace regrade::testing {
namespace {

std::vector<std::string> Seeds() {
  std::string bytes = MakeNpyHeader(ArrayType::kF64, {2, 17});
  for (int row = 0; row < 2; ++row) {
    // Columns: down, right, backward, position, size; then the bounds.
    const double values[17] = {0,   1, 0, 1.0 + row, 480, -1,  0,   0, 2,
                               640, 0, 0, 1,         3,   500, 1.5, 20};
    bytes.append(reinterpret_cast<const char*>(values), sizeof values);
  }
  return {bytes};
}

bool Read(std::string_view bytes) {
  const std::string path = FuzzFile("poses_bounds.npy", bytes);
  return Accepts([&path] {
    const LlffPoses poses = ReadPosesBounds(path);
    FuzzRequire(poses.nearest > 0 && poses.farthest > poses.nearest, "0 < near < far");
    for (const Camera& c : poses.cameras) {
      const double side = std::max(c.width, c.height);
      FuzzRequire(c.fx > 0.05 * side && c.fx < 100 * side, "a focal length is one of a lens");
      FuzzRequire(std::abs(c.camera_from_world.rotation.Determinant() - 1) < 1e-9,
                  "a pose is a rotation");
      FuzzRequire(Norm(c.camera_from_world.translation) < 2e12, "no camera is at infinity");
    }
  });
}

bool IsRotation(const Camera& camera) {
  return std::abs(camera.camera_from_world.rotation.Determinant() - 1) < 1e-9;
}

std::vector<std::string> IntrinsicsSeeds() {
  return {"500 0 320 0\n0 510 240 0\n0 0 1 0\n0 0 0 1\n", "500 0 320\n0 510 240\n0 0 1\n",
          "875.0 400.0 400.0 0.\n0. 0. 0.\n0.\n1.\n800 800\n"};
}

bool ReadIntrinsics(std::string_view bytes) {
  const std::string path = FuzzFile("intrinsics.txt", bytes);
  return Accepts([&path] {
    const Camera camera = ReadNsvfIntrinsics(path);
    FuzzRequire(camera.fx > 0 && camera.fy > 0, "focal lengths are positive");
    FuzzRequire(std::isfinite(camera.fx + camera.fy + camera.cx + camera.cy),
                "intrinsics are finite");
  });
}

std::vector<std::string> PoseSeeds() {
  return {"0 0 1 1\n-1 0 0 2\n0 -1 0 3\n0 0 0 1\n", "1 0 0 -4\n0 1 0 5.5\n0 0 1 1e3"};
}

bool ReadPose(std::string_view bytes) {
  const std::string path = FuzzFile("pose.txt", bytes);
  return Accepts([&path] {
    Camera camera;
    camera.camera_from_world = ReadNsvfPose(path);
    FuzzRequire(IsRotation(camera), "a pose is a rotation");
  });
}

std::vector<std::string> BoxSeeds() { return {"-1 -2 -3 4 5 6 0.4\n", "0 0 0\n1 1 1\n"}; }

bool ReadBox(std::string_view bytes) {
  const std::string path = FuzzFile("bbox.txt", bytes);
  return Accepts([&path] { FuzzRequire(IsSound(ReadNsvfBox(path)), "a box has a volume"); });
}

std::string MutateNumbers(std::string text, FuzzRandom* random) {
  return MutateText(std::move(text), {"1e999", "nan", "-0", "1e-320", "0x1p3"}, random);
}

std::vector<std::string> DtuSeeds() {
  const double world[16] = {2892, 0, 823, 100, 0, 2883, 619, 50, 0, 0, 1, 600, 0, 0, 0, 1};
  const double scale[16] = {250, 0, 0, 1, 0, 250, 0, 2, 0, 0, 250, 600, 0, 0, 0, 1};
  NpzWriter writer;
  writer.Add("world_mat_0", {4, 4}, world);
  writer.Add("scale_mat_0", {4, 4}, scale);
  writer.Add("world_mat_1", {4, 4}, world);
  const std::string archive = BytesOf(writer);
  return {archive, StoredCopyOfNpz(FuzzFile("seed.npz", archive))};
}

bool ReadDtu(std::string_view bytes) {
  const std::string path = FuzzFile("cameras.npz", bytes);
  return Accepts([&path] {
    for (const auto& [number, camera] : ReadDtuCameras(path)) {
      FuzzRequire(number >= 0, "a picture's number");
      FuzzRequire(camera.fx > 0 && camera.fy > 0, "focal lengths are positive");
      FuzzRequire(std::isfinite(camera.fx + camera.fy + camera.cx + camera.cy) &&
                      std::isfinite(Norm(camera.camera_from_world.translation)),
                  "cameras are finite");
      FuzzRequire(IsRotation(camera), "a pose is a rotation");
    }
  });
}

}  // namespace

std::vector<FuzzTarget> PoseTableTargets() {
  return {{"poses_bounds", Seeds, Read, MutateNpy, 25000},
          {"nsvf_intrinsics", IntrinsicsSeeds, ReadIntrinsics, MutateNumbers, 25000},
          {"nsvf_pose", PoseSeeds, ReadPose, MutateNumbers, 25000},
          {"nsvf_box", BoxSeeds, ReadBox, MutateNumbers, 25000},
          {"dtu_cameras", DtuSeeds, ReadDtu, MutateNpz, 15000}};
}

}  // namespace regrade::testing
