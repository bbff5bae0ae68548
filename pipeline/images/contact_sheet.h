// Pictures side by side with words under them, as one picture.
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
  std::string title;  // of a block that begins here; empty goes on with the last one
  std::vector<SheetCell> cells;
};

// Every cell is as wide as the widest picture; a row is as high as its highest. `columns` are
// the words above each block's cells.
Image MakeContactSheet(const std::vector<std::string>& columns,
                       const std::vector<SheetRow>& rows);

}  // namespace regrade
