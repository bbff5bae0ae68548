#include "pipeline/page/color_code.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "pipeline/page/value_transform.h"

namespace regrade {
namespace {

constexpr int kBins = 4096;              // of magnitudes
constexpr int kMostBits = 12;            // of a number
constexpr size_t kMostFitted = 1 << 18;  // splats that a code is fitted to

// The errors of one number's values, by its bits.
class NumberErrors {
 public:
  NumberErrors(double finest, double largest)
      : finest_(finest), width_(std::max(largest, 1e-9) / (kBins - 1)), count_(kBins) {}

  void Add(double value, double weight) {
    count_[static_cast<size_t>(std::min(kBins - 1.0, std::abs(value) / width_ + 0.5))] +=
        weight;
  }
  // After the last value.
  void Finish() {
    std::array<std::vector<double>, 3> above;
    for (std::vector<double>& sums : above) sums.resize(kBins + 1);
    for (int m = kBins - 1; m >= 0; --m) {
      // Sums over all bins from here up: weights, values, squares.
      const double n = count_[static_cast<size_t>(m)], v = m * width_;
      above[0][static_cast<size_t>(m)] = above[0][static_cast<size_t>(m) + 1] + n;
      above[1][static_cast<size_t>(m)] = above[1][static_cast<size_t>(m) + 1] + n * v;
      above[2][static_cast<size_t>(m)] = above[2][static_cast<size_t>(m) + 1] + n * v * v;
    }
    for (int bits = 1; bits <= kMostBits; ++bits)
      best_[static_cast<size_t>(bits)] = Fit(bits, above);
    count_ = {};
  }

  struct Choice {
    double error = 0, step = 1;
  };
  const Choice& Best(int bits) const { return best_[static_cast<size_t>(bits)]; }

 private:
  // Values beyond a limit become the limit; few large ones may cost less than a wide step.
  Choice Fit(int bits, const std::array<std::vector<double>, 3>& above) const {
    const int levels = (1 << (bits - 1)) - 1;
    if (levels == 0) return {above[2][0], 1};
    Choice best{-1, 1};
    for (double last = kBins - 1; last >= 1; last *= 0.84) {
      const double step = std::max({finest_, last * width_ / levels, 1e-9});
      const double limit = step * levels;
      const auto first = static_cast<size_t>(std::min(limit / width_, kBins - 1.0)) + 1;
      const double clamped =
          above[2][first] - 2 * limit * above[1][first] + limit * limit * above[0][first];
      // What is not clamped is rounded, but nothing is lost where all is 0.
      const double error = std::max(clamped, 0.0) + above[0][0] * step * step / 12;
      if (best.error < 0 || error < best.error) best = {error, step};
      if (step == finest_) break;
    }
    return best;
  }

  double finest_, width_;
  std::vector<double> count_;  // weights
  std::array<Choice, kMostBits + 1> best_;
};

using Numbers = std::array<double, kCodeNumbers>;  // of one splat, a basis + j

Numbers Transformed(const float* values, const ColorCode& code, int basis) {
  double turned[3][kCodeHarmonics] = {};
  for (int c = 0; c < 3; ++c)
    for (int j = 0; j < basis; ++j)
      for (int k = 0; k < basis; ++k)
        turned[c][j] += code.harmonics[static_cast<size_t>(kCodeHarmonics * j + k)] *
                        double{values[c * basis + k]};
  Numbers y{};
  for (int a = 0; a < 3; ++a)
    for (int j = 0; j < basis; ++j)
      for (int c = 0; c < 3; ++c)
        y[static_cast<size_t>(a * basis + j)] +=
            code.opponent[static_cast<size_t>(3 * a + c)] * turned[c][j];
  return y;
}

// Matrices that decorrelate channels, and then harmonics of all channels alike.
void FitTransforms(const std::vector<float>& spread, int basis, ColorCode* code) {
  const size_t channels = static_cast<size_t>(3 * basis), n = spread.size() / channels;
  std::vector<float> rows;
  const auto at = [&](size_t i, int c, int k) {
    return spread[i * channels + static_cast<size_t>(c * basis + k)];
  };
  for (size_t i = 0; i < n; ++i)
    for (int k = 0; k < basis; ++k)
      for (int c = 0; c < 3; ++c) rows.push_back(at(i, c, k));
  const ValueTransform opponent = DecorrelatingTransform(rows, 3);
  std::copy(opponent.matrix.begin(), opponent.matrix.end(), code->opponent.begin());

  // Rows of harmonics, each channel's scaled to the same power: bits count, not sizes.
  std::array<double, 3> power{};
  const auto turned = [&](size_t i, int a, int k) {
    double y = 0;
    for (int c = 0; c < 3; ++c)
      y += code->opponent[static_cast<size_t>(3 * a + c)] * at(i, c, k);
    return y;
  };
  for (size_t i = 0; i < n; ++i)
    for (int a = 0; a < 3; ++a)
      for (int k = 0; k < basis; ++k)
        power[static_cast<size_t>(a)] += std::pow(turned(i, a, k), 2);
  rows.clear();
  for (size_t i = 0; i < n; ++i)
    for (int a = 0; a < 3; ++a)
      for (int k = 0; k < basis; ++k)
        rows.push_back(static_cast<float>(
            turned(i, a, k) / std::sqrt(std::max(power[static_cast<size_t>(a)], 1e-12))));
  const ValueTransform harmonics = DecorrelatingTransform(rows, basis);
  for (int j = 0; j < basis; ++j)
    for (int k = 0; k < basis; ++k)
      code->harmonics[static_cast<size_t>(kCodeHarmonics * j + k)] =
          harmonics.matrix[static_cast<size_t>(j * basis + k)];
}

std::vector<NumberErrors> ErrorsOf(const std::vector<float>& values, const ColorCode& code,
                                   int basis, double finest, const std::vector<float>& weight) {
  const size_t channels = static_cast<size_t>(3 * basis);
  std::vector<Numbers> rows(values.size() / channels);
  std::vector<double> largest(channels);
  for (size_t i = 0; i < rows.size(); ++i) {
    rows[i] = Transformed(values.data() + i * channels, code, basis);
    for (size_t c = 0; c < channels; ++c)
      largest[c] = std::max(largest[c], std::abs(rows[i][c]));
  }
  std::vector<NumberErrors> errors;
  for (const double most : largest) errors.emplace_back(finest, most);
  for (size_t i = 0; i < rows.size(); ++i)
    for (size_t c = 0; c < channels; ++c)
      errors[c].Add(rows[i][c], weight.empty() ? 1 : double{weight[i]});
  for (NumberErrors& e : errors) e.Finish();
  return errors;
}

std::vector<double> NumbersIn(const JsonValue& json, const char* key, size_t count) {
  std::vector<double> numbers;
  for (const JsonValue& value : json.At(key).AsArray()) numbers.push_back(value.AsDouble());
  if (numbers.size() != count)
    throw InputError(Concat(numbers.size(), " numbers, ", count, " expected"), key);
  return numbers;
}

}  // namespace

std::vector<size_t> FittedRows(size_t n) {
  std::vector<size_t> fitted;
  for (size_t i = 0; i < n; i += n / kMostFitted + 1) fitted.push_back(i);
  return fitted;
}

ColorCode FitColorCode(const std::vector<float>& spread, const std::vector<float>& values,
                       int basis, double finest, const std::vector<float>& weight) {
  ColorCode code;
  for (size_t j = 0; j < kCodeHarmonics; ++j) code.harmonics[(kCodeHarmonics + 1) * j] = 1;
  code.step.fill(1);
  code.bits.fill(1);
  FitTransforms(spread, basis, &code);
  const std::vector<NumberErrors> errors = ErrorsOf(values, code, basis, finest, weight);
  for (size_t w = 0; w < kCodeWords; ++w) {
    // A bit goes where it lowers the error most, until the word is full or all are as fine as
    // wanted. One bit alone may gain nothing where two gain much.
    const auto error = [&](int number, int bits) {
      return errors[static_cast<size_t>(number / kCodeHarmonics * basis +
                                        number % kCodeHarmonics)]
          .Best(bits)
          .error;
    };
    int rest = 32 - (kWordBegins[w + 1] - kWordBegins[w]);
    while (rest > 0) {
      int best = -1, width = 0;
      double most = 0;
      for (int s = kWordBegins[w]; s < kWordBegins[w + 1]; ++s) {
        const int number = kCodeOrder[static_cast<size_t>(s)];
        if (number % kCodeHarmonics >= basis) continue;
        const int bits = code.bits[static_cast<size_t>(number)];
        for (int more = 1; more <= std::min({rest, 2, kMostBits - bits}); ++more) {
          const double gain = (error(number, bits) - error(number, bits + more)) / more;
          if (gain > most) most = gain, best = number, width = more;
        }
      }
      if (best < 0) break;
      code.bits[static_cast<size_t>(best)] += width;
      rest -= width;
    }
  }
  for (int number = 0; number < kCodeNumbers; ++number) {
    const int j = number % kCodeHarmonics, a = number / kCodeHarmonics;
    if (j >= basis) continue;
    const double step = errors[static_cast<size_t>(a * basis + j)]
                            .Best(code.bits[static_cast<size_t>(number)])
                            .step;
    code.step[static_cast<size_t>(number)] = std::max(std::round(step * 1e9) / 1e9, 1e-9);
  }
  return code;
}

std::vector<int16_t> NumbersOf(const ColorRows& rows, const ColorCode& code) {
  const int basis = rows.basis;
  const size_t n = rows.size();
  std::vector<int16_t> numbers(static_cast<size_t>(3 * basis) * n);
#pragma omp parallel for schedule(static)
  for (size_t i = 0; i < n; ++i) {
    const Numbers y = Transformed(rows[i], code, basis);
    for (int a = 0; a < 3; ++a)
      for (int j = 0; j < basis; ++j) {
        const int number = kCodeHarmonics * a + j;
        const double most = code.limit(number);
        const size_t c = static_cast<size_t>(a * basis + j);
        const double q = std::floor(y[c] / code.step[static_cast<size_t>(number)] + 0.5);
        numbers[c * n + i] = static_cast<int16_t>(std::clamp(q, -most, most));
      }
  }
  return numbers;
}

void PutValues(const std::vector<int16_t>& numbers, const ColorCode& code, int basis,
               const std::vector<int64_t>& splat, float* values) {
  const size_t n = splat.size();
#pragma omp parallel for schedule(static)
  for (size_t i = 0; i < n; ++i) {
    double turned[3][kCodeHarmonics] = {};
    for (int a = 0; a < 3; ++a)
      for (int j = 0; j < basis; ++j) {
        const double y = numbers[static_cast<size_t>(a * basis + j) * n + i] *
                         code.step[static_cast<size_t>(kCodeHarmonics * a + j)];
        for (int c = 0; c < 3; ++c)
          turned[c][j] += code.opponent[static_cast<size_t>(3 * a + c)] * y;
      }
    float* const row = values + 3 * basis * splat[i];
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < basis; ++k) {
        double sum = 0;
        for (int j = 0; j < basis; ++j)
          sum += code.harmonics[static_cast<size_t>(kCodeHarmonics * j + k)] * turned[c][j];
        row[c * basis + k] = static_cast<float>(sum);
      }
  }
}

std::string WordsOf(const std::vector<int16_t>& numbers, const ColorCode& code) {
  const size_t n = numbers.size() / kCodeNumbers;
  std::string bytes(4 * kCodeWords * n, '\0');
#pragma omp parallel for schedule(static)
  for (size_t i = 0; i < n; ++i)
    for (size_t w = 0; w < kCodeWords; ++w) {
      uint32_t word = 0;
      int rest = 32;
      for (int s = kWordBegins[w]; s < kWordBegins[w + 1]; ++s) {
        const auto number = static_cast<size_t>(kCodeOrder[static_cast<size_t>(s)]);
        const int bits = code.bits[number];
        rest -= bits;
        word |= (static_cast<uint32_t>(numbers[number * n + i]) & ((1u << bits) - 1)) << rest;
      }
      for (size_t b = 0; b < 4; ++b)
        bytes[4 * (kCodeWords * i + w) + b] = static_cast<char>(word >> (8 * b) & 255);
    }
  return bytes;
}

JsonValue JsonOf(const ColorCode& code) {
  const auto array = [](const auto& values) {
    return JsonValue::Array(values.begin(), values.end());
  };
  return JsonValue::Object{{"opponent", array(code.opponent)},
                           {"harmonics", array(code.harmonics)},
                           {"step", array(code.step)},
                           {"bits", array(code.bits)}};
}

ColorCode ColorCodeOf(const JsonValue& json) {
  ColorCode code;
  const auto fill = [&json](const char* key, auto* into, double least, double most) {
    const std::vector<double> numbers = NumbersIn(json, key, into->size());
    for (size_t i = 0; i < numbers.size(); ++i) {
      if (!(numbers[i] >= least && numbers[i] <= most))
        throw InputError("a number is out of range", key);
      (*into)[i] = static_cast<std::remove_reference_t<decltype((*into)[i])>>(numbers[i]);
    }
  };
  fill("opponent", &code.opponent, -1.001, 1.001);
  fill("harmonics", &code.harmonics, -1.001, 1.001);
  fill("step", &code.step, 0, 1e30);
  fill("bits", &code.bits, 1, kMostBits);
  for (size_t w = 0; w < kCodeWords; ++w) {
    int sum = 0;
    for (int s = kWordBegins[w]; s < kWordBegins[w + 1]; ++s)
      sum += code.bits[static_cast<size_t>(kCodeOrder[static_cast<size_t>(s)])];
    if (sum > 32) throw InputError("a word has more than 32 bits", "bits");
  }
  return code;
}

}  // namespace regrade
