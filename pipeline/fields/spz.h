// Niantic's SPZ (nianticlabs/spz), versions 2 to 4. All numbers are little-endian.
//
// Header: "NGSP", u32 version, u32 splats, u8 degree, u8 fractional bits, u8 flags (1: fitted
// with Mip-Splatting's filter, 2: there are extensions). Version 2 and 3 are one gzip file:
// that header, a byte 0, the attributes, the extensions. Version 4 is not packed as a whole:
// the header, u8 streams, u32 offset of the table, 12 bytes, the extensions, the table (u64
// packed and u64 unpacked size of each stream), and the attributes, each packed by Zstandard.
//
// Attributes, of all splats one after the other: positions (3 signed numbers of 24 bits, in
// units of 2^-bits), opacities (u8 / 255), colours (3 u8: the first harmonic is
// (u / 255 - 1/2) / 0.15), scales (3 u8: the logarithm is u / 16 - 10), rotations (version 2:
// 3 u8, x y z = u / 127.5 - 1 with w >= 0; then a u32: 2 bits for which of x y z w is largest,
// 10 for each of the others, a sign and 9 bits of 1 / sqrt(2)), other harmonics (u8: (u - 128)
// / 128, the three channels of each).
//
// Axes are right, up and back, or what Adobe's extension 0xADBE0003 says (1 to 8: bits of the
// value less 1, set for right, up and front). An extension is a u32 type, a u32 size and bytes.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "pipeline/fields/splat_scene.h"

namespace regrade {

// Whether the bytes begin as an SPZ file does, or as a gzip file.
bool LooksLikeSpz(std::string_view bytes);

// The whole file. Throws Error(kInput), see ReadSplats.
SplatScene ReadSpz(std::string_view bytes, uint64_t budget, const std::string& where);

}  // namespace regrade
