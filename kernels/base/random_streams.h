// Names of the random streams that are derived from a run's seed.
#pragma once

#include <cstdint>

namespace regrade {

// Salts, combined with the seed by XOR (see random.h): each purpose draws independent numbers.
inline constexpr uint64_t kRandomTotalVariation = 0x7476;     // start of the regularised run
inline constexpr uint64_t kRandomSphereVariation = 0x6d7369;  // the same for background layers
inline constexpr uint64_t kRandomSplatNoise = 0x73706c;       // of EQ(splat-noise)
inline constexpr uint64_t kRandomSplatSource = 0x736f75;      // which splats are copied
inline constexpr uint64_t kRandomSplatViews = 0x766965;       // the order of photos in a fit
inline constexpr uint64_t kRandomSplatDropout = 0x64726f;     // of EQ(splat-dropout)
inline constexpr uint64_t kRandomSplatPlaces = 0x706c61;      // initial splats without a point
inline constexpr uint64_t kRandomSynthNoise = 0x5e4507;  // sensor noise of synthetic photos
inline constexpr uint64_t kRandomSynthModel = 0x7a11;    // errors of synthetic poses, points

// Streams of the seed itself, for the exposure gains of synthetic photos.
inline constexpr uint64_t kStreamSynthGainPhase = 0x6a1;
inline constexpr uint64_t kStreamSynthGainJump = 0x6a2;

}  // namespace regrade
