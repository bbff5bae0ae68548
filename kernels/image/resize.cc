#include "kernels/image/resize.h"

#include <algorithm>
#include <vector>

#include "kernels/base/error.h"

namespace regrade {
namespace {

// One new pixel as a weighted mean of old pixels first, first + 1, ...; weights sum to 1.
struct PixelTaps {
  int first = 0;
  std::vector<double> weights;
};

std::vector<PixelTaps> AxisTaps(int old_size, int new_size) {
  std::vector<PixelTaps> taps(new_size);
  const double scale = static_cast<double>(old_size) / new_size;  // old pixels per new pixel
  for (int i = 0; i < new_size; ++i) {
    PixelTaps& t = taps[i];
    if (new_size == old_size) {
      t = {i, {1.0}};
    } else if (new_size < old_size) {
      // Borders as integers in units of 1 / new_size: neighbours share them exactly, and
      // weights are exact fractions.
      const int64_t begin = static_cast<int64_t>(i) * old_size, end = begin + old_size;
      t.first = static_cast<int>(begin / new_size);
      for (int64_t x = t.first; x * new_size < end; ++x) {
        const int64_t covered =
            std::min(end, (x + 1) * new_size) - std::max(begin, x * new_size);
        t.weights.push_back(static_cast<double>(covered) / old_size);
      }
    } else {
      const double centre = std::clamp((i + 0.5) * scale - 0.5, 0.0, old_size - 1.0);
      t.first = std::min(static_cast<int>(centre), std::max(old_size - 2, 0));
      const double fraction = centre - t.first;
      t.weights.push_back(1.0 - fraction);
      if (fraction > 0) t.weights.push_back(fraction);
    }
  }
  return taps;
}

// Adds weight * row to the sums; with an alpha channel, colours are premultiplied by it.
void AddRow(const Image& source, int y, double weight, std::vector<double>* sums) {
  const float* row = source.at(0, y);
  const size_t n = sums->size();
  if (source.channels != 4) {
    for (size_t i = 0; i < n; ++i) (*sums)[i] += weight * row[i];
    return;
  }
  for (size_t i = 0; i < n; i += 4) {
    const double alpha = weight * row[i + 3];
    for (int c = 0; c < 3; ++c) (*sums)[i + c] += alpha * row[i + c];
    (*sums)[i + 3] += alpha;
  }
}

}  // namespace

Image Resize(const Image& source, int width, int height) {
  REGRADE_CHECK_GT(width, 0);
  REGRADE_CHECK_GT(height, 0);
  REGRADE_CHECK(!source.empty());
  if (width == source.width && height == source.height) return source;
  const std::vector<PixelTaps> columns = AxisTaps(source.width, width);
  const std::vector<PixelTaps> rows = AxisTaps(source.height, height);
  const int channels = source.channels;
  Image result(width, height, channels);
#pragma omp parallel for schedule(static)
  for (int y = 0; y < height; ++y) {
    std::vector<double> sums(static_cast<size_t>(source.width) * channels);
    const PixelTaps& row = rows[y];
    for (size_t k = 0; k < row.weights.size(); ++k)
      AddRow(source, row.first + static_cast<int>(k), row.weights[k], &sums);
    for (int x = 0; x < width; ++x) {
      const PixelTaps& column = columns[x];
      double value[4] = {};
      for (size_t k = 0; k < column.weights.size(); ++k)
        for (int c = 0; c < channels; ++c)
          value[c] += column.weights[k] * sums[(column.first + k) * channels + c];
      if (channels == 4 && value[3] > 0)
        for (int c = 0; c < 3; ++c) value[c] /= value[3];
      for (int c = 0; c < channels; ++c) result.at(x, y)[c] = static_cast<float>(value[c]);
    }
  }
  return result;
}

}  // namespace regrade
