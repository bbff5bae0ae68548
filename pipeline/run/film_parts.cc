#include "pipeline/run/film_parts.h"

#include <cstdio>

#include "kernels/base/error.h"

namespace regrade {

PartNumber ParsePart(const std::string& text) {
  constexpr int kMostParts = 100000;
  PartNumber part;
  int read = 0;
  if (std::sscanf(text.c_str(), "%6d/%6d%n", &part.number, &part.parts, &read) != 2 ||
      read != static_cast<int>(text.size()) || part.number < 1 || part.number > part.parts ||
      part.parts > kMostParts)
    throw UsageError("is not K/N, a part and their number", "--part " + text,
                     "the first of eight parts is --part 1/8");
  return part;
}

}  // namespace regrade
