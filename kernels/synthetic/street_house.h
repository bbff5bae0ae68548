// Houses of a street: boxes with doors, windows, bays, balconies and cornices in relief.
#pragma once

#include "kernels/base/vec.h"
#include "kernels/synthetic/scene_builder.h"

namespace regrade {

struct HouseLot {
  Vec3d front;             // middle of the facade's foot, world
  double yaw_degrees = 0;  // 0: the facade faces -y; counterclockwise
  double width = 8, depth = 9;
  int storeys = 3;
};

// Draws the house's looks. Doorsteps stand out of the facade by 0.62, balconies by 0.85,
// awnings by 1.25.
void AddHouse(const HouseLot& lot, Dice& dice, SceneBuilder& b);

}  // namespace regrade
