// Takes zip archives of uncompressed members apart and builds them with correct sizes and
// checksums: mutants of the members pass these checks.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tests/fuzz/fuzz_target.h"

namespace regrade::testing {

struct ZipPart {
  std::string name, bytes;
};

std::string BuildStoredZip(const std::vector<ZipPart>& parts);
// Empty for archives of another form than BuildStoredZip's; checksums are ignored.
std::optional<std::vector<ZipPart>> TakeStoredZip(const std::string& bytes);

// The arrays of an .npz as uncompressed members.
std::string StoredCopyOfNpz(const std::string& path);

// Mutates an .npy file: its header, with a corrected length, or its data.
std::string MutateNpy(std::string bytes, FuzzRandom* random);
// Mutates an .npz: one array, names and order, or the archive's bytes.
std::string MutateNpz(std::string bytes, FuzzRandom* random);

}  // namespace regrade::testing
