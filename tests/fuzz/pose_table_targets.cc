// Fuzz target: poses_bounds.npy of LLFF captures.
#include <algorithm>
#include <cmath>

#include "pipeline/capture/llff_poses.h"
#include "pipeline/files/npy_header.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/mutate.h"
#include "tests/fuzz/stored_zip.h"

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

}  // namespace

std::vector<FuzzTarget> PoseTableTargets() {
  return {{"poses_bounds", Seeds, Read, MutateNpy, 25000}};
}

}  // namespace regrade::testing
