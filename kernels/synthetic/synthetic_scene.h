// Analytic scenes with known ground truth, and the cameras that photograph them.
//
// World: z is up, lengths are about metres. Everything visible from a default camera lies
// inside the scene's bounds.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "kernels/scene/camera.h"
#include "kernels/synthetic/solid.h"

namespace regrade {

struct SyntheticScene {
  std::string name;
  std::vector<Solid> solids;
  Vec3d to_sun;           // unit
  double sun = 0.95;      // fraction of full light reflected by a surface facing the sun
  double ambient = 0.45;  // and in the shade
  Vec3d bounds_min, bounds_max;
};

// For the help text and errors.
inline constexpr char kSyntheticSceneNames[] = "table|wall|room|square|street";

// The shapes are fixed; `seed` determines the paint. Throws Error (kUsage) for an unknown name,
// listing the known ones.
//   table:  a still life before a curved tiled wall, seen from an arc of 80 degrees
//   wall:   a wall with shelves and reliefs, cameras on a small plane facing it
//   room:   a furnished room, cameras on a loop inside, each facing the far side
//   square: a still life on a pedestal seen from all around, with houses and hills up to 45
//           times as far away as the cameras
//   street: 300 m of houses, trees and parked cars on both sides, up one way and back the other
SyntheticScene MakeSyntheticScene(const std::string& name, uint64_t seed);

// `views` cameras on a closed smooth path: neighbours in the list are neighbours in space, and
// the first is surrounded by others (a held-out view is never at the rim). Pinhole, focal
// length 0.9 to 1.15 times the width, principal point at the centre.
std::vector<Camera> SyntheticCameras(const SyntheticScene& scene, int views, int width,
                                     int height);

}  // namespace regrade
