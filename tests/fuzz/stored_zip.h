// Zip archives of members that are not packed, taken apart and put together with right sizes
// and checksums, so that mutants of what is inside get past both.
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
// Nothing for what BuildStoredZip would not have made; checksums are not looked at.
std::optional<std::vector<ZipPart>> TakeStoredZip(const std::string& bytes);

// The arrays of an .npz as members that are not packed.
std::string StoredCopyOfNpz(const std::string& path);

// Mutants of an .npy file: of its header, whose length is put right, or of its data.
std::string MutateNpy(std::string bytes, FuzzRandom* random);
// Mutants of an .npz: of one array, of names and order, or of the archive's own bytes.
std::string MutateNpz(std::string bytes, FuzzRandom* random);

}  // namespace regrade::testing
