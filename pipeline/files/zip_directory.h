// What a zip archive says it holds, believed only where its two descriptions of a member agree
// and no two members share a byte.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace regrade {

struct ZipMember {
  std::string name;
  int method = 0;  // 0 stored, 8 deflated; others are refused
  uint64_t compressed_bytes = 0;
  uint64_t bytes = 0;  // as declared
  uint64_t data_offset = 0;
};

// Fills `size` bytes from `offset`, or throws.
using ReadAt = std::function<void(uint64_t offset, void* to, size_t size)>;

// Reads the central directory and every local header of an archive of `file_bytes`. Refused:
// directories that do not fit the file, headers that disagree, overlapping members, names
// twice, encryption, deflate ratios above 1032 (more than deflate can do), archives in several
// parts. Throws Error(kInput) naming the member; `where` names the file.
std::vector<ZipMember> ReadZipDirectory(uint64_t file_bytes, const ReadAt& read_at,
                                        const std::string& where);

}  // namespace regrade
