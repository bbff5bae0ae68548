#include "pipeline/fields/spz.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "kernels/base/error.h"
#include "pipeline/fields/colored_splat.h"
#include "pipeline/files/byte_packing.h"
#include "pipeline/files/deflate.h"
#include "pipeline/files/zstd.h"

namespace regrade {
namespace {

constexpr std::string_view kMark = "NGSP", kGzip = "\x1f\x8b";
constexpr size_t kHeader = 16, kHeaderOf4 = 32;
constexpr int kFirstVersion = 2, kSmallestThree = 3, kZstd = 4, kLastVersion = 4;
constexpr uint8_t kAntialiased = 1, kExtensions = 2;
constexpr uint32_t kAxes = 0xADBE0003;
// A file whose splats all differ is packed 2 to 5 times; beyond this it is no scene.
constexpr uint64_t kMostRatio = 100, kAlwaysUnpacked = 1 << 16;
constexpr char kDamagedSpz[] = "the file is incomplete or damaged: copy or download it again";

[[noreturn]] void Refuse(const std::string& why, const std::string& where,
                         const std::string& hint = kDamagedSpz) {
  throw InputError("SPZ: " + why, where, hint);
}

uint8_t ByteAt(std::string_view bytes, size_t i) { return static_cast<uint8_t>(bytes[i]); }

struct SpzHeader {
  uint32_t version = 0, count = 0;
  uint8_t degree = 0, fractional_bits = 0, flags = 0, streams = 0;
};

enum Attribute {
  kPositions,
  kOpacities,
  kColors,
  kScales,
  kRotations,
  kHarmonics,
  kAttributes
};

struct Attributes {
  SpzHeader header;
  std::array<size_t, kAttributes> size{};  // bytes of one splat
  std::array<std::string_view, kAttributes> bytes;
  std::string_view extensions;
  std::vector<std::string> unpacked;  // what `bytes` may refer to

  const uint8_t* Of(Attribute attribute, size_t splat) const {
    return reinterpret_cast<const uint8_t*>(bytes[attribute].data()) + splat * size[attribute];
  }
};

uint64_t MostUnpacked(std::string_view packed, uint64_t budget) {
  return std::min(kAlwaysUnpacked + kMostRatio * packed.size(), budget);
}

// Checks the header and fills in the sizes. `available`: the most bytes that there can be.
void ReadHeader(std::string_view bytes, uint64_t available, const std::string& where,
                Attributes* a) {
  if (bytes.size() < kHeader || !bytes.starts_with(kMark)) Refuse("it has no header", where);
  SpzHeader& header = a->header;
  ByteUnpacker unpack(bytes.substr(kMark.size()));
  unpack.Value(&header.version);
  unpack.Value(&header.count);
  unpack.Value(&header.degree);
  unpack.Value(&header.fractional_bits);
  unpack.Value(&header.flags);
  unpack.Value(&header.streams);
  if (header.version < kFirstVersion || header.version > kLastVersion)
    Refuse(Concat("version ", header.version, "; 2 to 4 are read"), where,
           "convert it to PLY (`splat-transform IN.spz OUT.ply`)");
  if (header.degree > 4 || header.fractional_bits > 31)
    Refuse(Concat("degree ", int{header.degree}, " and ", int{header.fractional_bits},
                  " fractional bits"),
           where);
  const size_t others = static_cast<size_t>(BasisOfDegree(header.degree)) - 1;
  a->size = {9, 1, 3, 3, header.version >= kSmallestThree ? size_t{4} : size_t{3}, 3 * others};
  uint64_t splat = 0;
  for (const size_t size : a->size) splat += size;
  if (header.count > available / splat)
    Refuse(Concat("its header says ", header.count, " splats of ", splat,
                  " bytes, but there are at most ", available, " bytes"),
           where);
}

// Versions 2 and 3, unpacked.
void SplitStream(std::string_view bytes, Attributes* a) {
  size_t at = kHeader;
  for (size_t i = 0; i < kAttributes; ++i) {
    a->bytes[i] = bytes.substr(at, a->size[i] * a->header.count);
    at += a->size[i] * a->header.count;
  }
  a->extensions = bytes.substr(at);
}

// Version 4.
void UnpackStreams(std::string_view bytes, const std::string& where, Attributes* a) {
  const size_t streams = a->header.degree > 0 ? 6 : 5;
  uint32_t table = 0;
  ByteUnpacker offset(bytes.substr(kHeader));
  offset.Value(&table);
  if (a->header.streams != streams || table < kHeaderOf4 || bytes.size() < table + 16 * streams)
    Refuse("its table of streams is not within the file", where);
  a->extensions = bytes.substr(kHeaderOf4, table - kHeaderOf4);
  ByteUnpacker entries(bytes.substr(table));
  std::string_view left = bytes.substr(table + 16 * streams);
  a->unpacked.resize(streams);  // strings do not move while views refer to them
  for (size_t i = 0; i < streams; ++i) {
    uint64_t packed = 0, unpacked = 0;
    entries.Value(&packed);
    entries.Value(&unpacked);
    if (packed > left.size() || unpacked != a->size[i] * a->header.count)
      Refuse("its table of streams disagrees with its header", where);
    a->unpacked[i] = UnpackZstd(left.substr(0, packed), unpacked, where);
    a->bytes[i] = a->unpacked[i];
    left.remove_prefix(packed);
  }
}

Attributes ReadAttributes(std::string_view bytes, uint64_t budget, const std::string& where) {
  Attributes attributes;
  if (bytes.starts_with(kGzip)) {
    attributes.unpacked.push_back(Gunzip(bytes, MostUnpacked(bytes, budget), where));
    bytes = attributes.unpacked[0];
    if (!bytes.starts_with(kMark))
      throw InputError("a gzip file, but not of splats in SPZ", where, "unpack it first");
    ReadHeader(bytes, bytes.size() - std::min(bytes.size(), kHeader), where, &attributes);
    if (attributes.header.version >= kZstd) Refuse("version 4 within gzip", where);
    SplitStream(bytes, &attributes);
    return attributes;
  }
  // Versions 2 and 3 that are not packed exist, too.
  const bool packed = bytes.size() >= kHeader && ByteAt(bytes, kMark.size()) >= kZstd;
  ReadHeader(
      bytes,
      packed ? MostUnpacked(bytes, budget) : bytes.size() - std::min(bytes.size(), kHeader),
      where, &attributes);
  if (packed)
    UnpackStreams(bytes, where, &attributes);
  else
    SplitStream(bytes, &attributes);
  return attributes;
}

// To right, down, front. Adds the other extensions to `ignored`.
Mat3d TurnOf(const Attributes& a, const std::string& where, std::vector<std::string>* ignored) {
  uint32_t axes = 4;
  std::string_view left = a.header.flags & kExtensions ? a.extensions : "";
  while (left.size() >= 8) {
    uint32_t type = 0, size = 0, value = 0;
    ByteUnpacker unpack(left);
    unpack.Value(&type);
    unpack.Value(&size);
    if (size > left.size() - 8) Refuse("an extension goes beyond the end", where);
    unpack.Value(&value);
    if (type != kAxes)
      ignored->push_back(Format("extension 0x%08X", type));
    else if (size == 4 && value > 0)
      axes = value;
    left.remove_prefix(8 + size_t{size});
  }
  if (axes > 8)
    Refuse(Concat("axes of kind ", axes, "; 1 to 8 are read"), where,
           "write it with the axes right, up and back");
  Mat3d turn;
  turn(0, 0) = (axes - 1) & 1 ? 1 : -1;
  turn(1, 1) = (axes - 1) & 2 ? -1 : 1;
  turn(2, 2) = (axes - 1) & 4 ? 1 : -1;
  return turn;
}

void UnpackRotation(const uint8_t* bytes, uint32_t version, float* quaternion) {
  double xyzw[4] = {}, square = 0;
  uint32_t largest = 3;
  if (version < kSmallestThree) {
    for (int a = 0; a < 3; ++a) xyzw[a] = bytes[a] / 127.5 - 1;
  } else {
    const uint32_t packed =
        bytes[0] | bytes[1] << 8 | bytes[2] << 16 | uint32_t{bytes[3]} << 24;
    largest = packed >> 30;
    int shift = 30;
    for (uint32_t a = 0; a < 4; ++a) {
      if (a == largest) continue;
      shift -= 10;
      const double size = (packed >> shift & 511) / 511.0 * std::sqrt(0.5);
      xyzw[a] = packed >> shift & 512 ? -size : size;
    }
  }
  for (const double q : xyzw) square += q * q;
  xyzw[largest] = std::sqrt(std::max(0.0, 1 - square));
  for (int a = 0; a < 4; ++a) quaternion[a] = static_cast<float>(xyzw[(a + 3) % 4]);
}

ColoredSplat Unpack(const Attributes& a, size_t i, int basis) {
  ColoredSplat record;
  const uint8_t *position = a.Of(kPositions, i), *color = a.Of(kColors, i),
                *scale = a.Of(kScales, i), *harmonics = a.Of(kHarmonics, i);
  for (int axis = 0; axis < 3; ++axis, position += 3) {
    const int fixed = position[0] | position[1] << 8 | (position[2] ^ 128) << 16;
    record.splat.mean[axis] =
        static_cast<float>(std::ldexp(fixed - (1 << 23), -int{a.header.fractional_bits}));
    record.splat.log_scale[axis] = static_cast<float>(scale[axis] / 16.0 - 10);
    record.sh[axis * basis] = static_cast<float>((color[axis] / 255.0 - 0.5) / 0.15);
    for (int k = 1; k < basis; ++k)
      record.sh[axis * basis + k] =
          static_cast<float>((harmonics[3 * (k - 1) + axis] - 128) / 128.0);
  }
  UnpackRotation(a.Of(kRotations, i), a.header.version, record.splat.quaternion);
  record.splat.opacity_logit = LogitOfByte(*a.Of(kOpacities, i));
  return record;
}

}  // namespace

bool LooksLikeSpz(std::string_view bytes) {
  return bytes.starts_with(kMark) || bytes.starts_with(kGzip);
}

SplatScene ReadSpz(std::string_view bytes, uint64_t budget, const std::string& where) {
  const Attributes attributes = ReadAttributes(bytes, budget, where);
  const SpzHeader& header = attributes.header;
  const int basis = std::min(BasisOfDegree(header.degree), kMaxBasis);
  std::vector<std::string> ignored;
  const SplatTurn turn(TurnOf(attributes, where, &ignored));
  SplatCollector collector(header.count, basis, bytes.size(), budget, where);
  for (uint32_t i = 0; i < header.count; ++i) {
    ColoredSplat record = Unpack(attributes, i, basis);
    turn.Apply(basis, &record);
    collector.Add(record);
  }
  SplatScene scene = std::move(collector).Finish();
  scene.format = SplatFormat::kSpz;
  scene.antialiased = header.flags & kAntialiased;
  scene.ignored = std::move(ignored);
  if (header.degree > 3)
    scene.notes.push_back("the harmonics of degree 4 are left out: the file has more than 3");
  return scene;
}

}  // namespace regrade
