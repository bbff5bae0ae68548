#include "pipeline/fields/compressed_ply.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "kernels/base/error.h"
#include "pipeline/fields/colored_splat.h"
#include "pipeline/fields/gaussian_ply.h"
#include "pipeline/fields/ply_rows.h"
#include "pipeline/files/text.h"

namespace regrade {
namespace {

constexpr uint64_t kChunk = 256;

// Three numbers each.
struct Bounds {
  std::array<double, 3> low{}, high{};
  // `share` in [0, 1].
  float At(size_t axis, double share) const {
    return static_cast<float>(low[axis] * (1 - share) + high[axis] * share);
  }
};
struct Chunk {
  Bounds mean, scale, color;
};

constexpr std::array<const char*, 4> kPacked = {"packed_position", "packed_rotation",
                                                "packed_scale", "packed_color"};

[[noreturn]] void RefuseCompressed(const std::string& why, const std::string& where) {
  throw InputError("compressed PLY: " + why, where,
                   "convert it again (`splat-transform IN OUT.ply`)");
}

// The index of a property, which must have the type.
size_t Column(const PlyElement& element, const std::string& name, PlyType type,
              const std::string& where) {
  const std::optional<size_t> found = element.Find(name);
  if (!found || element.properties[*found].count_type ||
      element.properties[*found].type != type)
    RefuseCompressed("element '" + element.name + "' has no " + name + ", or of another type",
                     where);
  return *found;
}

// The columns min_PREFIXa and max_PREFIXa for the three letters a.
std::array<size_t, 6> BoundColumns(const PlyElement& element, const std::string& prefix,
                                   const char* letters, const std::string& where) {
  std::array<size_t, 6> columns{};
  for (size_t a = 0; a < 3; ++a) {
    columns[a] = Column(element, "min_" + prefix + letters[a], PlyType::kF32, where);
    columns[3 + a] = Column(element, "max_" + prefix + letters[a], PlyType::kF32, where);
  }
  return columns;
}

Bounds BoundsOf(const PlyRows& rows, const std::array<size_t, 6>& columns) {
  Bounds bounds;
  for (size_t a = 0; a < 3; ++a) {
    bounds.low[a] = rows.Number(columns[a]);
    bounds.high[a] = rows.Number(columns[3 + a]);
  }
  return bounds;
}

std::vector<Chunk> ReadChunks(std::string_view bytes, const PlyHeader& header,
                              const std::string& where) {
  const size_t index = *header.Find("chunk");
  const PlyElement& element = header.elements[index];
  const auto mean = BoundColumns(element, "", "xyz", where),
             scale = BoundColumns(element, "scale_", "xyz", where);
  const bool colored = element.Find("min_r").has_value();
  const auto color =
      colored ? BoundColumns(element, "", "rgb", where) : std::array<size_t, 6>{};
  PlyRows rows(bytes, header, index, where);  // compares the count with the file's size
  std::vector<Chunk> chunks(element.count);
  for (Chunk& chunk : chunks) {
    rows.Next();
    chunk.mean = BoundsOf(rows, mean);
    chunk.scale = BoundsOf(rows, scale);
    chunk.color = colored ? BoundsOf(rows, color) : Bounds{{0, 0, 0}, {1, 1, 1}};
  }
  return chunks;
}

// The `bits` of `value` that `shift` others follow, in [0, 1].
double Share(uint32_t value, int shift, int bits) {
  const uint32_t most = (1u << bits) - 1;
  return (value >> shift & most) / static_cast<double>(most);
}

void UnpackRotation(uint32_t packed, float* quaternion) {
  double square = 0;
  const uint32_t largest = packed >> 30;
  int shift = 30;
  for (uint32_t a = 0; a < 4; ++a) {
    if (a == largest) continue;
    shift -= 10;
    const double q = (Share(packed, shift, 10) - 0.5) * std::sqrt(2.0);
    quaternion[a] = static_cast<float>(q);
    square += q * q;
  }
  quaternion[largest] = static_cast<float>(std::sqrt(std::max(0.0, 1 - square)));
}

// All but the harmonics of higher degrees. `packed` in the order of kPacked.
ColoredSplat Unpack(const Chunk& chunk, const std::array<uint32_t, 4>& packed, int basis) {
  constexpr int kShift[] = {21, 11, 0}, kBits[] = {11, 10, 11};
  ColoredSplat record;
  for (size_t a = 0; a < 3; ++a) {
    const int axis = static_cast<int>(a);
    record.splat.mean[axis] = chunk.mean.At(a, Share(packed[0], kShift[a], kBits[a]));
    record.splat.log_scale[axis] = chunk.scale.At(a, Share(packed[2], kShift[a], kBits[a]));
    const double color = double{chunk.color.At(a, Share(packed[3], 24 - 8 * axis, 8))};
    record.sh[axis * basis] = static_cast<float>((color - 0.5) / kSh0);
  }
  UnpackRotation(packed[1], record.splat.quaternion);
  record.splat.opacity_logit = LogitOfByte(static_cast<int>(packed[3] & 255));
  return record;
}

// The columns f_rest_* of element `sh`.
std::vector<size_t> HarmonicColumns(const PlyElement& element, const std::string& where) {
  const size_t count = element.properties.size();
  if (count != 9 && count != 24 && count != 45)
    RefuseCompressed(Concat("element 'sh' has ", count, " properties; 9, 24 or 45 are read"),
                     where);
  std::vector<size_t> columns;
  for (size_t k = 0; k < count; ++k)
    columns.push_back(Column(element, Concat("f_rest_", k), PlyType::kU8, where));
  return columns;
}

// The middle of a byte's step; the first and the last byte are the ends.
float HarmonicOf(double byte) {
  const double share = byte == 0 ? 0 : byte == 255 ? 1 : (byte + 0.5) / 256;
  return static_cast<float>(8 * (share - 0.5));
}

}  // namespace

bool IsCompressedPly(const PlyHeader& header) {
  const std::optional<size_t> vertex = header.Find("vertex");
  return vertex && header.Find("chunk") && header.elements[*vertex].Find(kPacked[0]);
}

SplatScene ReadCompressedPly(std::string_view bytes, const PlyHeader& header, uint64_t budget,
                             const std::string& where) {
  if (header.encoding == PlyEncoding::kAscii)
    RefuseCompressed("a text, which no program writes", where);
  const std::vector<Chunk> chunks = ReadChunks(bytes, header, where);
  const size_t vertex = *header.Find("vertex");
  const PlyElement& vertices = header.elements[vertex];
  std::array<size_t, 4> packed{};
  for (size_t i = 0; i < 4; ++i) packed[i] = Column(vertices, kPacked[i], PlyType::kU32, where);
  if (vertices.count / kChunk + (vertices.count % kChunk > 0) != chunks.size())
    RefuseCompressed(
        Concat(vertices.count, " splats in ", chunks.size(), " chunks of ", kChunk), where);
  PlyRows rows(bytes, header, vertex, where);

  const std::optional<size_t> sh = header.Find("sh");
  std::vector<size_t> columns;
  std::optional<PlyRows> harmonics;
  if (sh) {
    columns = HarmonicColumns(header.elements[*sh], where);
    if (header.elements[*sh].count != vertices.count)
      RefuseCompressed("its elements 'vertex' and 'sh' differ in their numbers", where);
    harmonics.emplace(bytes, header, *sh, where);
  }
  const int others = static_cast<int>(columns.size() / 3), basis = 1 + others;
  SplatCollector collector(vertices.count, basis, bytes.size(), budget, where);
  for (uint64_t i = 0; i < vertices.count; ++i) {
    rows.Next();
    std::array<uint32_t, 4> numbers{};
    for (size_t k = 0; k < 4; ++k) numbers[k] = static_cast<uint32_t>(rows.Number(packed[k]));
    ColoredSplat record = Unpack(chunks[i / kChunk], numbers, basis);
    if (harmonics) {
      harmonics->Next();
      for (int k = 0; k < 3 * others; ++k)
        record.sh[k / others * basis + 1 + k % others] =
            HarmonicOf(harmonics->Number(columns[static_cast<size_t>(k)]));
    }
    collector.Add(std::move(record));
  }
  SplatScene scene = std::move(collector).Finish();
  scene.format = SplatFormat::kCompressedPly;
  scene.antialiased = SaysAntialiased(header);
  for (size_t i = 0; i < header.elements.size(); ++i) {
    const std::string& name = header.elements[i].name;
    if (name != "chunk" && name != "vertex" && name != "sh")
      scene.ignored.push_back("element " + Printable(name));
  }
  return scene;
}

}  // namespace regrade
