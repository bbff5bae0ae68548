#include "pipeline/page/value_codec.h"

#include "kernels/base/error.h"

namespace regrade {
namespace {

// `number` is one channel; the splats before `earlier` are known.
int Prediction(const int16_t* number, const EarlierRecords& earlier) {
  int sum = 0, n = 0;
  for (const int32_t other : earlier)
    if (other >= 0) sum += number[other], ++n;
  if (n <= 1) return sum;
  return sum >= 0 ? sum / n : -((-sum + n - 1) / n);  // rounded down
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
        Concat(bytes.size(), " bytes for ", channels, " channels of ", n, " splats"));
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

}  // namespace regrade
