// The code of a splat's colours: numbers fit their bits, errors are as small as these allow.
#include "pipeline/page/color_code.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <vector>

#include "kernels/base/random.h"
#include "tests/support/expect_error.h"

namespace regrade {
namespace {

// Coefficients [n, 3, basis] as a scene's: channels alike, what changes with the view is small.
std::vector<float> SomeValues(int n, int basis, double view) {
  std::vector<float> values;
  for (int i = 0; i < n; ++i)
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < basis; ++k) {
        const auto draw = [&](uint64_t stream, int own) {
          return RandomDouble(5, stream, static_cast<uint64_t>(100 * i + own)) - 0.5;
        };
        const double size = k == 0 ? 3 : view;
        values.push_back(static_cast<float>(
            size * (0.9 * draw(1, k) + 0.1 * draw(2, 10 * c + k) * (c + 1))));
      }
  return values;
}

std::vector<int64_t> AllOf(size_t n) {
  std::vector<int64_t> splat(n);
  std::iota(splat.begin(), splat.end(), 0);
  return splat;
}

std::vector<int16_t> Numbers(const std::vector<float>& values, const ColorCode& code,
                             int basis) {
  const std::vector<int64_t> splat = AllOf(values.size() / static_cast<size_t>(3 * basis));
  return NumbersOf({values.data(), basis, splat}, code);
}

std::vector<float> Values(const std::vector<int16_t>& numbers, const ColorCode& code,
                          int basis) {
  std::vector<float> values(numbers.size());
  PutValues(numbers, code, basis, AllOf(numbers.size() / static_cast<size_t>(3 * basis)),
            values.data());
  return values;
}

double MeanSquare(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += std::pow(double{a[i]} - double{b[i]}, 2);
  return sum / static_cast<double>(a.size());
}

// EQ(page-color-code)
TEST(PageColorCode, NumbersFitTheirBitsAndComeBack) {
  for (const int basis : {1, 4, 9}) {
    const std::vector<float> values = SomeValues(500, basis, 0.4);
    const ColorCode code = FitColorCode(values, values, basis, 0.03);
    for (size_t w = 0; w < kCodeWords; ++w) {
      int bits = 0;
      for (int s = kWordBegins[w]; s < kWordBegins[w + 1]; ++s)
        bits += code.bits[static_cast<size_t>(kCodeOrder[static_cast<size_t>(s)])];
      EXPECT_LE(bits, 32);
    }
    const std::vector<int16_t> numbers = Numbers(values, code, basis);
    const std::vector<float> rounded = Values(numbers, code, basis);
    for (int a = 0; a < 3; ++a)
      for (int j = 0; j < basis; ++j)
        for (size_t i = 0; i < 500; ++i)
          EXPECT_LE(std::abs(numbers[static_cast<size_t>(a * basis + j) * 500 + i]),
                    code.limit(9 * a + j));
    // Where all steps are the finest one, errors are uniform within half a step.
    EXPECT_LE(MeanSquare(values, rounded), 1.05 * 0.03 * 0.03 / 12);
    EXPECT_EQ(Numbers(rounded, code, basis), numbers);
  }
}

// What needs more than 128 bits at the step is rounded more coarsely, and no more than that:
// 27 numbers of 4.74 bits within +-1.6 have errors of 0.035.
TEST(PageColorCode, WideValuesLoseLittle) {
  std::vector<float> values;
  for (uint64_t i = 0; i < 27 * 500; ++i)
    values.push_back(static_cast<float>(2 * RandomDouble(7, 1, i) - 1));
  const ColorCode code = FitColorCode(values, values, 9, 0.001);
  const double error = std::sqrt(MeanSquare(values, Values(Numbers(values, code, 9), code, 9)));
  EXPECT_LT(error, 0.045);
  EXPECT_GT(error, 0.01);
}

TEST(PageColorCode, WordsHoldTheNumbers) {
  const std::vector<float> values = SomeValues(20, 9, 0.4);
  const ColorCode code = FitColorCode(values, values, 9, 0.03);
  const std::vector<int16_t> numbers = Numbers(values, code, 9);
  const std::string words = WordsOf(numbers, code);
  ASSERT_EQ(words.size(), 20u * 16);
  for (size_t i = 0; i < 20; ++i)
    for (size_t w = 0; w < kCodeWords; ++w) {
      uint32_t word = 0;
      for (size_t b = 0; b < 4; ++b)
        word |= static_cast<uint32_t>(static_cast<unsigned char>(words[16 * i + 4 * w + b]))
                << 8 * b;
      for (int s = kWordBegins[w]; s < kWordBegins[w + 1]; ++s) {
        const auto number = static_cast<size_t>(kCodeOrder[static_cast<size_t>(s)]);
        EXPECT_EQ(static_cast<int32_t>(word) >> (32 - code.bits[number]),
                  numbers[number * 20 + i]);
        word <<= code.bits[number];
      }
    }
}

TEST(PageColorCode, JsonComesBackAndDamageIsRefused) {
  const std::vector<float> values = SomeValues(50, 9, 0.4);
  const ColorCode code = FitColorCode(values, values, 9, 0.03);
  const JsonValue json = JsonOf(code);
  EXPECT_EQ(DumpJson(JsonOf(ColorCodeOf(ParseJson(DumpJson(json), "test")))), DumpJson(json));
  JsonValue wide = json, thin = json, few = json;
  wide["bits"] = JsonValue::Array(27, JsonValue(9));
  EXPECT_REGRADE_ERROR(ColorCodeOf(wide), ExitCode::kInput, "more than 32 bits");
  thin["bits"] = JsonValue::Array(27, JsonValue(0));
  EXPECT_REGRADE_ERROR(ColorCodeOf(thin), ExitCode::kInput, "out of range");
  few["step"] = JsonValue::Array(26, JsonValue(1));
  EXPECT_REGRADE_ERROR(ColorCodeOf(few), ExitCode::kInput, "27 expected");
}

// Splats of a field in another order have its numbers in that order, and go back to their rows.
TEST(PageColorCode, RowsMayComeInAnyOrder) {
  const std::vector<float> values = SomeValues(30, 9, 0.4);
  const ColorCode code = FitColorCode(values, values, 9, 0.03);
  const std::vector<int16_t> all = Numbers(values, code, 9);
  const std::vector<int64_t> splat = {17, 3, 29, 0};
  const std::vector<int16_t> chosen = NumbersOf({values.data(), 9, splat}, code);
  std::vector<float> back(values.size());
  PutValues(chosen, code, 9, splat, back.data());
  const std::vector<float> rounded = Values(all, code, 9);
  for (size_t i = 0; i < splat.size(); ++i)
    for (size_t c = 0; c < 27; ++c) {
      EXPECT_EQ(chosen[c * 4 + i], all[c * 30 + static_cast<size_t>(splat[i])]);
      EXPECT_EQ(back[27 * static_cast<size_t>(splat[i]) + c],
                rounded[27 * static_cast<size_t>(splat[i]) + c]);
    }
  EXPECT_EQ(back[27], 0);  // of splat 1, which was not chosen
}

TEST(PageColorCode, AMillionSplatsAreFittedToSome) {
  EXPECT_EQ(FittedRows(5).size(), 5u);
  EXPECT_TRUE(FittedRows(0).empty());
  const std::vector<size_t> some = FittedRows(1000000);
  EXPECT_LE(some.size(), size_t{1} << 18);
  EXPECT_GT(some.size(), size_t{1} << 17);
  EXPECT_GT(some.back(), 999990u);
}

// A field of one colour, or without splats, has a code.
TEST(PageColorCode, NothingToDecorrelate) {
  const std::vector<float> grey(27 * 10, 0.25f);
  const ColorCode code = FitColorCode(std::vector<float>(27 * 10, 0.0f), grey, 9, 0.03);
  EXPECT_LE(MeanSquare(grey, Values(Numbers(grey, code, 9), code, 9)), 0.02 * 0.02);
  EXPECT_NO_THROW(ColorCodeOf(JsonOf(FitColorCode({}, {}, 9, 0))));
}

}  // namespace
}  // namespace regrade
