// Rounds values of voxels to whole numbers and packs them into bytes.
//
// EQ(page-prediction): a voxel's number q in each channel is stored as q - p, p the mean of the
// numbers of its earlier neighbours (1 to 3), rounded down; 0 for the first voxel. Differences
// are stored as 2 d for d >= 0 and -2 d - 1 otherwise, channel by channel: the low bytes of all
// voxels, then the high bytes. All of it is arithmetic on integers, so that every reader gets
// the same numbers.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/page/page_order.h"
#include "pipeline/page/value_transform.h"

namespace regrade {

inline constexpr int kMaxNumber = 16383;  // differences of such numbers fit in 16 bits

// `number` [channels, V], within +-kMaxNumber; the result has 2 channels V bytes.
std::string PackNumbers(const std::vector<int16_t>& number, int channels,
                        const std::vector<EarlierRecords>& earlier);
// Throws Error(kInput) for bytes of another size and numbers out of range.
std::vector<int16_t> UnpackNumbers(std::string_view bytes, int channels,
                                   const std::vector<EarlierRecords>& earlier);

// EQ(page-density): q = sign(sigma) round(sqrt(|sigma| w / tau)), w the width of a voxel and
// tau = kPageOpticalDepth. Photon noise grows as the square root; so does the error that a
// sample's opacity may have where many samples share a ray.
inline constexpr double kPageOpticalDepth = 4e-4;
int16_t DensityNumber(double density, double width);
double DensityOfNumber(int16_t number, double width);

// values [V, channels] -> numbers [channels, V] in units of `step` along the transform's axes.
std::vector<int16_t> NumbersOf(const std::vector<float>& values,
                               const ValueTransform& transform, double step);
// Back: [V, channels].
std::vector<float> ValuesOf(const std::vector<int16_t>& numbers,
                            const ValueTransform& transform, double step);

// values [V, channels] minus the mean of the earlier neighbours' values.
std::vector<float> Differences(const std::vector<float>& values, int channels,
                               const std::vector<EarlierRecords>& earlier);

// What a graphics processor holds of a value: code [0, 255] of 8 bits, (code - 128) * scale.
// The scale of a channel, from the largest magnitude among the values [V, channels].
std::vector<double> CodeScales(const std::vector<float>& values, int channels);
uint8_t CodeOf(double value, double scale);

}  // namespace regrade
