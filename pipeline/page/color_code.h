// A splat's colours in 128 bits: what a page stores, and what a graphics processor holds of
// them.
//
// EQ(page-color-code): of coefficients s [3, basis] the numbers are
//   q_aj = round(y_aj / step_aj),  y_aj = sum_ck opponent_ac harmonics_jk s_ck,
// two orthogonal transforms, of the channels and of the harmonics, so that a ray needs one sum
// of harmonics for each j and a sample one product with the channels' matrix. A number has
// bits_aj bits, two's complement within +-(2^(bits-1) - 1). A splat is four words of 32 bits;
// the numbers of a word, kCodeOrder's, follow each other from the highest bit down.
//
// Rounding in y is rounding in s: transposed matrices lead back, and sums of squares stay.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/files/json_file.h"

namespace regrade {

inline constexpr int kCodeHarmonics = 9, kCodeNumbers = 27, kCodeWords = 4;

// The numbers of each word, as 9 a + j: large and small ones in each, so that all words fill.
inline constexpr std::array<int, kCodeWords + 1> kWordBegins = {0, 7, 14, 21, 27};
inline constexpr std::array<int, kCodeNumbers> kCodeOrder = {0,  11, 4,  21, 14, 24, 17, 1,  18,
                                                             19, 6,  7,  16, 25, 9,  3,  12, 13,
                                                             22, 23, 26, 2,  10, 5,  20, 15, 8};

// Harmonics that a basis lacks have rows of the identity, and numbers that are 0 in one bit.
struct ColorCode {
  std::array<double, 9> opponent{};                                 // [3, 3], the largest first
  std::array<double, kCodeHarmonics * kCodeHarmonics> harmonics{};  // [9, 9]
  std::array<double, kCodeNumbers> step{};                          // of 9 a + j
  std::array<int, kCodeNumbers> bits{};

  int limit(int number) const { return (1 << (bits[static_cast<size_t>(number)] - 1)) - 1; }
};

// Splats' coefficients where a field has them.
struct ColorRows {
  const float* values = nullptr;  // [3, basis] of each splat, channel-major
  int basis = 9;
  const std::vector<int64_t>& splat;  // [n]: whose these are

  size_t size() const { return splat.size(); }
  const float* operator[](size_t i) const { return values + 3 * basis * splat[i]; }
};

// Of n splats those that a code is fitted to: all, or every second, third, ...
std::vector<size_t> FittedRows(size_t n);

// The transforms that decorrelate `spread` [n, 3, basis] (channel-major), and for `values`
// [n, 3, basis] the bits and steps of least squared error, none below `finest`. `weight` [n]:
// of each splat's error; empty: all alike. The identity's for n = 0.
ColorCode FitColorCode(const std::vector<float>& spread, const std::vector<float>& values,
                       int basis, double finest, const std::vector<float>& weight = {});

// Numbers [3 basis, n], those of (a, j) in row a basis + j.
std::vector<int16_t> NumbersOf(const ColorRows& rows, const ColorCode& code);
// Back, to the rows that they came from; `values` as in ColorRows.
void PutValues(const std::vector<int16_t>& numbers, const ColorCode& code, int basis,
               const std::vector<int64_t>& splat, float* values);

// Numbers [27, n] of nine harmonics as words: 16 bytes a splat, the lowest of a word first.
std::string WordsOf(const std::vector<int16_t>& numbers, const ColorCode& code);

JsonValue JsonOf(const ColorCode& code);
// Throws Error(kInput) for anything else than what JsonOf makes.
ColorCode ColorCodeOf(const JsonValue& json);

}  // namespace regrade
