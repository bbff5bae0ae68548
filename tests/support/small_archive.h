// An .npz archive of four members, one of them deflated, as bytes.
#pragma once

#include <cstdint>
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

}  // namespace regrade::testing
