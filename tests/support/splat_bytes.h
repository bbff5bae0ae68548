// Files of splats, made byte by byte for tests of their readers.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "kernels/splats/splats.h"
#include "pipeline/fields/restyled_ply.h"

namespace regrade::testing {

template <typename T>
std::string LittleEndian(T value) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

// Colours [N, 3, basis] that must outlive the result; splats of `kept` [N] keep theirs.
inline NewColors ColorsOf(std::span<const float> sh, int basis, std::vector<bool> kept = {}) {
  const int64_t row = 3 * basis;
  return {std::ssize(sh) / row, basis, [=](int64_t i, float* to) {
            if (!kept.empty() && kept[static_cast<size_t>(i)]) return false;
            std::copy_n(sh.begin() + i * row, row, to);
            return true;
          }};
}

struct PlyStyle {
  std::string encoding = "binary_little_endian";
  std::string type = "float";  // or double
  bool backwards = false;      // the order of the properties
  bool extras = false;         // properties and elements that no splat has
  std::string comment;
};

// One number of a row.
inline std::string PlyNumber(const PlyStyle& style, double value) {
  if (style.encoding == "ascii") {
    char text[40];
    std::snprintf(text, sizeof text, "%.9g ", value);
    return text;
  }
  std::string bytes =
      style.type == "double" ? LittleEndian(value) : LittleEndian(static_cast<float>(value));
  if (style.encoding == "binary_big_endian") std::ranges::reverse(bytes);
  return bytes;
}

// The splats in the layout of the 3D Gaussian Splatting program.
inline std::string PlyOf(const Splats& splats, const PlyStyle& style = {}) {
  const size_t basis = static_cast<size_t>(splats.basis);
  const bool ascii = style.encoding == "ascii";
  std::vector<std::pair<std::string, std::vector<float>>> columns;
  const size_t count = splats.opacity_logit.size();
  const auto add = [&](const std::string& name, const std::vector<float>& from, size_t width,
                       size_t offset) {
    std::vector<float> column(count);
    for (size_t i = 0; i < count; ++i) column[i] = from[width * i + offset];
    columns.push_back({name, column});
  };
  for (size_t a = 0; a < 3; ++a) add(std::string(1, "xyz"[a]), splats.mean, 3, a);
  for (size_t c = 0; c < 3; ++c)
    add("f_dc_" + std::to_string(c), splats.sh, 3 * basis, c * basis);
  for (size_t c = 0; c < 3; ++c)
    for (size_t k = 1; k < basis; ++k)
      add("f_rest_" + std::to_string(c * (basis - 1) + k - 1), splats.sh, 3 * basis,
          c * basis + k);
  add("opacity", splats.opacity_logit, 1, 0);
  for (size_t a = 0; a < 3; ++a) add("scale_" + std::to_string(a), splats.log_scale, 3, a);
  for (size_t a = 0; a < 4; ++a) add("rot_" + std::to_string(a), splats.quaternion, 4, a);
  if (style.backwards) std::ranges::reverse(columns);

  std::string file = "ply\nformat " + style.encoding + " 1.0\n";
  if (!style.comment.empty()) file += "comment " + style.comment + "\n";
  if (style.extras)
    file += "obj_info made by hand\nelement face 2\nproperty list uchar uchar corners\n";
  file += "element vertex " + std::to_string(count) + "\n";
  if (style.extras) file += "property uchar label\nproperty list uchar char tags\n";
  for (const auto& column : columns)
    file += "property " + style.type + " " + column.first + "\n";
  if (style.extras) file += "element camera 1\nproperty uchar number\n";
  file += "end_header\n";
  const auto bytes = [&](const std::vector<int>& values) {
    for (const int value : values)
      file += ascii ? std::to_string(value) + " " : std::string(1, static_cast<char>(value));
  };
  if (style.extras) bytes({3, 0, 1, 2, 0});
  for (size_t i = 0; i < count; ++i) {
    if (style.extras) bytes({7, static_cast<int>(i % 2)});
    if (style.extras && i % 2 == 1) bytes({9});
    for (const auto& column : columns) file += PlyNumber(style, double{column.second[i]});
    if (ascii) file.back() = '\n';
  }
  if (style.extras) bytes({5});
  return file;
}

// A splat of an SPZ file in the bytes that it has there.
struct SpzSplat {
  int32_t position[3];
  uint8_t opacity, color[3], scale[3];
  uint32_t rotation;        // of version 2 the lower three bytes
  std::vector<uint8_t> sh;  // three channels of each coefficient
};

// The attributes of all splats one after the other.
inline std::vector<std::string> SpzAttributes(int version,
                                              const std::vector<SpzSplat>& splats) {
  std::vector<std::string> a(6);
  for (const SpzSplat& splat : splats) {
    for (const int32_t p : splat.position) a[0] += LittleEndian(p).substr(0, 3);
    a[1] += static_cast<char>(splat.opacity);
    for (const uint8_t c : splat.color) a[2] += static_cast<char>(c);
    for (const uint8_t s : splat.scale) a[3] += static_cast<char>(s);
    a[4] += LittleEndian(splat.rotation).substr(0, version == 2 ? 3 : 4);
    for (const uint8_t s : splat.sh) a[5] += static_cast<char>(s);
  }
  return a;
}

inline std::string SpzHeader(int version, uint32_t count, int degree, int bits, int flags,
                             int streams) {
  std::string header = "NGSP" + LittleEndian(uint32_t(version)) + LittleEndian(count);
  for (const int byte : {degree, bits, flags, streams}) header += static_cast<char>(byte);
  return header;
}

// Version 2 or 3 as it is within gzip.
inline std::string UnpackedSpz(int version, int degree, const std::vector<SpzSplat>& splats,
                               int flags = 0, const std::string& extensions = "") {
  std::string file = SpzHeader(version, uint32_t(splats.size()), degree, 12, flags, 0);
  for (const std::string& attribute : SpzAttributes(version, splats)) file += attribute;
  return file + extensions;
}

// A frame of Zstandard (RFC 8878) of one block that is not compressed.
inline std::string ZstdFrame(const std::string& bytes) {
  const uint32_t size = uint32_t(bytes.size());
  return "\x28\xb5\x2f\xfd\xa0" + LittleEndian(size) +
         LittleEndian(size << 3 | 1).substr(0, 3) + bytes;
}

inline std::string SpzOf4(int degree, const std::vector<SpzSplat>& splats, int flags = 0,
                          const std::string& extensions = "") {
  std::vector<std::string> attributes = SpzAttributes(4, splats);
  if (degree == 0) attributes.pop_back();
  std::string file = SpzHeader(4, uint32_t(splats.size()), degree, 12, flags,
                               static_cast<int>(attributes.size())) +
                     LittleEndian(uint32_t(32 + extensions.size())) + std::string(12, '\0') +
                     extensions;
  std::string frames;
  for (const std::string& attribute : attributes) {
    const std::string frame = ZstdFrame(attribute);
    file += LittleEndian(uint64_t{frame.size()}) + LittleEndian(uint64_t{attribute.size()});
    frames += frame;
  }
  return file + frames;
}

// Adobe's extension for the axes.
inline std::string SpzAxes(uint32_t kind) {
  return LittleEndian(0xADBE0003u) + LittleEndian(4u) + LittleEndian(kind);
}

struct CompressedPlyStyle {
  bool colors = true;  // chunks have bounds of colours
  int degree = 0;
  std::vector<uint32_t> packed;  // by vertex: position, rotation, scale, colour
  std::vector<uint8_t> sh;       // by vertex: f_rest_*
  std::vector<float> chunk;      // the numbers of all chunks
};

// PlayCanvas' compressed PLY.
inline std::string CompressedPlyOf(const CompressedPlyStyle& style) {
  const size_t columns = style.colors ? 18 : 12, vertices = style.packed.size() / 4;
  std::string file = "ply\nformat binary_little_endian 1.0\nelement chunk " +
                     std::to_string(style.chunk.size() / columns) + "\n";
  for (const std::string axis :
       {"x", "y", "z", "scale_x", "scale_y", "scale_z", "r", "g", "b"}) {
    if (!style.colors && axis.size() == 1 && axis[0] < 'x') continue;
    file += "property float min_" + axis + "\nproperty float max_" + axis + "\n";
  }
  file += "element vertex " + std::to_string(vertices) + "\n";
  for (const char* name : {"position", "rotation", "scale", "color"})
    file += std::string("property uint packed_") + name + "\n";
  const int rest = 3 * (style.degree * style.degree + 2 * style.degree);
  if (rest > 0) file += "element sh " + std::to_string(vertices) + "\n";
  for (int k = 0; k < rest; ++k) file += "property uchar f_rest_" + std::to_string(k) + "\n";
  file += "end_header\n";
  for (const float value : style.chunk) file += LittleEndian(value);
  for (const uint32_t value : style.packed) file += LittleEndian(value);
  for (const uint8_t value : style.sh) file += static_cast<char>(value);
  return file;
}

}  // namespace regrade::testing
