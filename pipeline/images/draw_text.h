// Words in pictures.
#pragma once

#include <string>

#include "kernels/scene/image.h"

namespace regrade {

// Height of a line of text of this size, pixels, with room above and below.
int TextLineHeight(double size);

// Writes `text` in grey of the given brightness into an RGB picture, its line from (x, y) down;
// what is longer than `width` pixels is drawn smaller, down to half, and then cut. Only ASCII
// is drawn, other bytes as '?'. `size` 1 is about 11 pixels for a capital.
void DrawText(Image* picture, int x, int y, int width, const std::string& text, double size,
              float brightness);

}  // namespace regrade
