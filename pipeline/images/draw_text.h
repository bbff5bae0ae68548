// Draws text into pictures.
#pragma once

#include <string>

#include "kernels/scene/image.h"

namespace regrade {

// Height of a line of text of this size with its margins, pixels.
int TextLineHeight(double size);

// Draws `text` in grey of the given brightness into an RGB picture, from (x, y) down. A text
// wider than `width` pixels is drawn smaller, down to half, and then cut. Bytes that are not
// ASCII are drawn as '?'. At `size` 1 a capital is about 11 pixels high.
void DrawText(Image* picture, int x, int y, int width, const std::string& text, double size,
              float brightness);

}  // namespace regrade
