#include "pipeline/images/contact_sheet.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "pipeline/images/draw_text.h"

namespace regrade {
namespace {

constexpr int kGap = 6;
constexpr float kPaper = 1, kInk = 0.4f;
constexpr double kCaptionSize = 0.8;

void Paste(const Image& picture, int x, int y, Image* sheet) {
  for (int v = 0; v < picture.height; ++v)
    std::copy_n(picture.at(0, v), 3 * picture.width, sheet->at(x, y + v));
}

int HeightOf(const SheetRow& row) {
  int height = 0;
  for (const SheetCell& cell : row) height = std::max(height, cell.picture.height);
  return height + TextLineHeight(kCaptionSize) + kGap;
}

}  // namespace

Image MakeContactSheet(const std::vector<SheetRow>& rows) {
  int cell = 1, height = kGap, columns = 0;
  for (const SheetRow& row : rows) {
    for (const SheetCell& c : row) {
      REGRADE_CHECK(c.picture.empty() || c.picture.channels == 3);
      cell = std::max(cell, c.picture.width);
    }
    columns = std::max(columns, static_cast<int>(row.size()));
    height += HeightOf(row);
  }
  Image sheet(kGap + columns * (cell + kGap), height);
  std::ranges::fill(sheet.pixels, kPaper);
  int y = kGap;
  for (const SheetRow& row : rows) {
    const int pictures = HeightOf(row) - TextLineHeight(kCaptionSize) - kGap;
    int x = kGap;
    for (const SheetCell& c : row) {
      if (!c.picture.empty()) Paste(c.picture, x, y, &sheet);
      DrawText(&sheet, x, y + pictures, cell, c.caption, kCaptionSize, kInk);
      x += cell + kGap;
    }
    y += HeightOf(row);
  }
  return sheet;
}

}  // namespace regrade
