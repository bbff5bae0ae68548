// Pictures that are read several times: decoded once and kept in memory.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "kernels/scene/image.h"

namespace regrade {

// ReadImage, or ReadGivenImage, for files that do not change meanwhile. A picture whose values
// are all k / 255 takes a byte for each; the first ones are kept, up to a limit. For one thread
// at a time; copies share what they keep.
class KeptPictures {
 public:
  enum class Origin { kOurs, kGiven };
  explicit KeptPictures(Origin origin, int64_t most_bytes = int64_t{320} << 20);

  // As the reader gives it, to the bit. Errors: its.
  Image Read(const std::string& path) const;
  // Decodes pictures that will be read, on all cores, as many as can be kept. Reports no
  // errors: Read does.
  void ReadAhead(const std::vector<std::string>& paths) const;

 private:
  struct Stored;
  struct Shared;
  Image Decode(const std::string& path) const;
  void Keep(const std::string& path, const Image& picture) const;

  Origin origin_;
  std::shared_ptr<Shared> shared_;
};

}  // namespace regrade
