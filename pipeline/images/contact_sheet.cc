#include "pipeline/images/contact_sheet.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "pipeline/images/draw_text.h"

namespace regrade {
namespace {

constexpr int kGap = 6;
constexpr float kPaper = 1, kInk = 0.1f, kSoftInk = 0.4f;
constexpr double kTitleSize = 1.2, kHeadSize = 1, kCaptionSize = 0.8;

void Paste(const Image& picture, int x, int y, Image* sheet) {
  for (int v = 0; v < picture.height; ++v)
    std::copy_n(picture.at(0, v), 3 * picture.width, sheet->at(x, y + v));
}

int HeightOf(const SheetRow& row) {
  int height = 0;
  for (const SheetCell& cell : row.cells) height = std::max(height, cell.picture.height);
  return height + TextLineHeight(kCaptionSize) + kGap;
}

int HeadHeight(const SheetRow& row) {
  return row.title.empty() ? 0 : TextLineHeight(kTitleSize) + TextLineHeight(kHeadSize) + kGap;
}

}  // namespace

Image MakeContactSheet(const std::vector<std::string>& columns,
                       const std::vector<SheetRow>& rows) {
  int cell = 1, height = kGap;
  for (const SheetRow& row : rows) {
    REGRADE_CHECK(row.cells.size() <= columns.size());
    for (const SheetCell& c : row.cells) {
      REGRADE_CHECK(c.picture.empty() || c.picture.channels == 3);
      cell = std::max(cell, c.picture.width);
    }
    height += HeadHeight(row) + HeightOf(row);
  }
  Image sheet(kGap + static_cast<int>(columns.size()) * (cell + kGap), height);
  std::ranges::fill(sheet.pixels, kPaper);
  int y = kGap;
  const auto x_of = [&](size_t column) {
    return kGap + static_cast<int>(column) * (cell + kGap);
  };
  for (const SheetRow& row : rows) {
    if (!row.title.empty()) {
      DrawText(&sheet, kGap, y, sheet.width - kGap, row.title, kTitleSize, kInk);
      y += TextLineHeight(kTitleSize);
      for (size_t k = 0; k < columns.size(); ++k)
        DrawText(&sheet, x_of(k), y, cell, columns[k], kHeadSize, kSoftInk);
      y += TextLineHeight(kHeadSize) + kGap;
    }
    const int pictures = HeightOf(row) - TextLineHeight(kCaptionSize) - kGap;
    for (size_t k = 0; k < row.cells.size(); ++k) {
      if (!row.cells[k].picture.empty()) Paste(row.cells[k].picture, x_of(k), y, &sheet);
      DrawText(&sheet, x_of(k), y + pictures, cell, row.cells[k].caption, kCaptionSize,
               kSoftInk);
    }
    y += HeightOf(row);
  }
  return sheet;
}

}  // namespace regrade
