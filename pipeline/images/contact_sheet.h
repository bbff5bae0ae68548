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

struct SheetRow {
  std::string title;  // of the block that begins with this row; empty: the last block goes on
  std::vector<SheetCell> cells;
};

// All cells are as wide as the widest picture; a row is as high as its highest one. `columns`:
// headings above the cells of each block.
Image MakeContactSheet(const std::vector<std::string>& columns,
                       const std::vector<SheetRow>& rows);

}  // namespace regrade
