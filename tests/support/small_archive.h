// An .npz archive of four members, one of them deflated, as bytes.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "pipeline/files/atomic_file.h"
#include "pipeline/files/npz_file.h"
#include "tests/support/temporary_folder.h"

namespace regrade::testing {

inline std::string BytesOf(const NpzWriter& writer) {
  const TemporaryFolder folder;
  writer.WriteTo(folder / "a.npz");
  return ReadWholeFile(folder / "a.npz", 1 << 20);
}

inline std::string SmallArchive() {
  static const float values[6] = {1, 2, 3, 4, 5, 6};
  static const std::vector<int32_t> ramp(1000, 7);
  NpzWriter writer;
  writer.Add("values", {2, 3}, values);
  writer.Add("ramp", {1000}, ramp.data(), NpzPacking::kDeflate);
  writer.AddScalar<double>("pi", 3.25);
  writer.AddText("note", "h\xc3\xa9llo");
  return BytesOf(writer);
}

// Writes `to` as `from` is, but for one array.
template <typename T>
void ReplaceArray(const std::string& from, const std::string& to, const std::string& name,
                  const std::vector<int64_t>& shape, const T* data) {
  NpzReader reader(from, 1 << 20);
  std::map<std::string, NpzArray> kept;
  for (const std::string& other : reader.names())
    if (other != name) kept.emplace(other, reader.Read(other));
  NpzWriter writer;
  for (const auto& member : kept) {
    const std::string& other = member.first;
    const NpzArray& array = member.second;
    if (array.type == ArrayType::kU8) writer.Add(other, array.shape, array.As<uint8_t>());
    if (array.type == ArrayType::kF16) writer.Add(other, array.shape, array.As<uint16_t>());
    if (array.type == ArrayType::kI32) writer.Add(other, array.shape, array.As<int32_t>());
    if (array.type == ArrayType::kI64) writer.Add(other, array.shape, array.As<int64_t>());
    if (array.type == ArrayType::kF32) writer.Add(other, array.shape, array.As<float>());
    if (array.type == ArrayType::kF64) writer.Add(other, array.shape, array.As<double>());
  }
  writer.Add(name, shape, data);
  writer.WriteTo(to);
}

}  // namespace regrade::testing
