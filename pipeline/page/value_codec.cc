#include "pipeline/page/value_codec.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"

namespace regrade {
namespace {

// `number` is one channel; the voxels before `earlier` are known.
int Prediction(const int16_t* number, const EarlierRecords& earlier) {
  int sum = 0, n = 0;
  for (const int32_t other : earlier)
    if (other >= 0) sum += number[other], ++n;
  if (n <= 1) return sum;
  return sum >= 0 ? sum / n : -((-sum + n - 1) / n);  // rounded down
}

int16_t Rounded(double value) {
  return static_cast<int16_t>(
      std::floor(std::clamp(value, -double{kMaxNumber}, double{kMaxNumber}) + 0.5));
}

}  // namespace

std::string PackNumbers(const std::vector<int16_t>& number, int channels,
                        const std::vector<EarlierRecords>& earlier) {
  const size_t n = earlier.size();
  std::string bytes(2 * n * static_cast<size_t>(channels), '\0');
#pragma omp parallel for schedule(dynamic)
  for (int k = 0; k < channels; ++k) {
    const int16_t* const own = number.data() + static_cast<size_t>(k) * n;
    char* const low = bytes.data() + 2 * n * static_cast<size_t>(k);
    for (size_t i = 0; i < n; ++i) {
      const int d = own[i] - Prediction(own, earlier[i]);
      const unsigned folded =
          d >= 0 ? 2 * static_cast<unsigned>(d) : 2 * static_cast<unsigned>(-d) - 1;
      low[i] = static_cast<char>(folded & 255);
      low[n + i] = static_cast<char>(folded >> 8);
    }
  }
  return bytes;
}

std::vector<int16_t> UnpackNumbers(std::string_view bytes, int channels,
                                   const std::vector<EarlierRecords>& earlier) {
  const size_t n = earlier.size();
  if (bytes.size() != 2 * n * static_cast<size_t>(channels))
    throw InputError(
        Concat(bytes.size(), " bytes for ", channels, " channels of ", n, " voxels"));
  std::vector<int16_t> number(n * static_cast<size_t>(channels));
  for (int k = 0; k < channels; ++k) {
    int16_t* const own = number.data() + static_cast<size_t>(k) * n;
    const char* const low = bytes.data() + 2 * n * static_cast<size_t>(k);
    for (size_t i = 0; i < n; ++i) {
      const int folded =
          static_cast<unsigned char>(low[i]) | static_cast<unsigned char>(low[n + i]) << 8;
      const int d = folded & 1 ? -(folded + 1) / 2 : folded / 2;
      const int value = Prediction(own, earlier[i]) + d;
      if (value < -kMaxNumber || value > kMaxNumber)
        throw InputError("a stored number is out of range");
      own[i] = static_cast<int16_t>(value);
    }
  }
  return number;
}

int16_t DensityNumber(double density, double width) {
  const double root = std::sqrt(std::abs(density) * width / kPageOpticalDepth);
  return Rounded(density < 0 ? -root : root);
}

double DensityOfNumber(int16_t number, double width) {
  const double squared = static_cast<double>(number) * number * kPageOpticalDepth / width;
  return number < 0 ? -squared : squared;
}

std::vector<int16_t> NumbersOf(const std::vector<float>& values,
                               const ValueTransform& transform, double step) {
  const int channels = transform.channels;
  const size_t n = values.size() / static_cast<size_t>(channels);
  std::vector<int16_t> numbers(values.size());
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < static_cast<int64_t>(n); ++i)
    for (int k = 0; k < channels; ++k) {
      double sum = 0;
      for (int j = 0; j < channels; ++j)
        sum += transform.matrix[static_cast<size_t>(k * channels + j)] *
               double{values[static_cast<size_t>(i * channels + j)]};
      numbers[static_cast<size_t>(k) * n + static_cast<size_t>(i)] = Rounded(sum / step);
    }
  return numbers;
}

std::vector<float> ValuesOf(const std::vector<int16_t>& numbers,
                            const ValueTransform& transform, double step) {
  const int channels = transform.channels;
  const size_t n = numbers.size() / static_cast<size_t>(channels);
  std::vector<float> values(numbers.size());
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < static_cast<int64_t>(n); ++i) {
    double sum[kMaxChannels] = {};
    for (int k = 0; k < channels; ++k) {
      const double y = numbers[static_cast<size_t>(k) * n + static_cast<size_t>(i)] * step;
      for (int j = 0; j < channels; ++j)
        sum[j] += transform.matrix[static_cast<size_t>(k * channels + j)] * y;
    }
    for (int j = 0; j < channels; ++j)
      values[static_cast<size_t>(i * channels + j)] = static_cast<float>(sum[j]);
  }
  return values;
}

std::vector<float> Differences(const std::vector<float>& values, int channels,
                               const std::vector<EarlierRecords>& earlier) {
  std::vector<float> difference(values.size());
  for (size_t i = 0; i < earlier.size(); ++i)
    for (int c = 0; c < channels; ++c) {
      float sum = 0, n = 0;
      for (const int32_t other : earlier[i])
        if (other >= 0) sum += values[static_cast<size_t>(other) * channels + c], ++n;
      difference[i * channels + c] = values[i * channels + c] - (n > 0 ? sum / n : 0);
    }
  return difference;
}

std::vector<double> CodeScales(const std::vector<float>& values, int channels) {
  std::vector<double> scale(static_cast<size_t>(channels), 0);
  for (size_t i = 0; i < values.size(); ++i) {
    double& largest = scale[i % static_cast<size_t>(channels)];
    largest = std::max(largest, std::abs(double{values[i]}));
  }
  for (double& s : scale) s = s > 0 ? s / 127 : 1;
  return scale;
}

uint8_t CodeOf(double value, double scale) {
  return static_cast<uint8_t>(std::floor(std::clamp(value / scale, -127.0, 127.0) + 128.5));
}

}  // namespace regrade
