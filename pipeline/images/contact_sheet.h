// Draws a table of captioned pictures as one picture.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/image.h"

namespace regrade {

struct SheetCell {
  Image picture;  // [H, W, 3] or empty
  std::string caption;
};

using SheetRow = std::vector<SheetCell>;

// All cells are as wide as the widest picture; a row is as high as its highest one.
Image MakeContactSheet(const std::vector<SheetRow>& rows);

}  // namespace regrade
