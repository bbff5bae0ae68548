#include "evaluate/edge_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/image/row_sum.h"

namespace regrade {
namespace {

struct Sum {
  double squares = 0, pixels = 0;
  Sum& operator+=(const Sum& o) {
    squares += o.squares;
    pixels += o.pixels;
    return *this;
  }
};

double Mean(const Image& image, int x, int y) {
  const int channels = std::min(image.channels, 3);
  double sum = 0;
  for (int c = 0; c < channels; ++c) sum += image.at(x, y)[c];
  return sum / channels;
}

}  // namespace

Image GradientEdges(const Image& picture) {
  const int width = picture.width, height = picture.height;
  std::vector<double> squares(static_cast<size_t>(picture.num_pixels()));
  const Sum sum = SumOverRows(height, [&](int y) {
    Sum row;
    for (int x = 0; x < width; ++x) {
      const double here = Mean(picture, x, y);
      const double dx = x + 1 < width ? Mean(picture, x + 1, y) - here : 0;
      const double dy = y + 1 < height ? Mean(picture, x, y + 1) - here : 0;
      const double square = here - here + dx * dx + dy * dy;  // NaN at the border, too
      squares[static_cast<size_t>(y) * width + x] = square;
      if (!std::isfinite(square)) continue;
      row.squares += square;
      row.pixels += 1;
    }
    return row;
  });
  const double mean = sum.pixels > 0 ? sum.squares / sum.pixels : 0;
  Image edges(width, height, 1);
  for (size_t i = 0; i < squares.size(); ++i) {
    const double edge = mean > 0 ? squares[i] / (squares[i] + mean) : 0;
    edges.pixels[i] = std::isfinite(squares[i]) ? static_cast<float>(edge)
                                                : std::numeric_limits<float>::quiet_NaN();
  }
  return edges;
}

}  // namespace regrade
