// Packs the numbers of splats into bytes.
//
// EQ(page-prediction): a splat's number q in each channel is stored as q - p, p the mean of the
// numbers of its earlier neighbours (1 to 3), rounded down; 0 for the first splat. Differences
// are stored as 2 d for d >= 0 and -2 d - 1 otherwise, channel by channel: the low bytes of all
// splats, then the high bytes. All of it is arithmetic on integers, so that every reader gets
// the same numbers.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace regrade {

// Up to three earlier splats, numbered in the page's order; -1: fewer.
using EarlierRecords = std::array<int32_t, 3>;

inline constexpr int kMaxNumber = 16383;  // differences of such numbers fit in 16 bits

// `number` [channels, n], within +-kMaxNumber; the result has 2 channels n bytes.
std::string PackNumbers(const std::vector<int16_t>& number, int channels,
                        const std::vector<EarlierRecords>& earlier);
// Throws Error(kInput) for bytes of another size and numbers out of range.
std::vector<int16_t> UnpackNumbers(std::string_view bytes, int channels,
                                   const std::vector<EarlierRecords>& earlier);

}  // namespace regrade
