// --part: the frames and films of a style made by several processes or machines.
#pragma once

#include <string>

namespace regrade {

inline constexpr char kJoinParts[] = "join";

struct FilmParts {
  std::string part;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("part", part,
         {.help = "K/N renders the K-th of N parts of the frames and films, to parts/ of the "
                  "style's folder, and nothing else; parts may be rendered at the same time, "
                  "on any machines that share the folder. join makes frames and films of the "
                  "parts instead of rendering, and goes on; their bytes do not depend on how "
                  "many there were",
          .once = true});
  }
  bool Join() const { return part == kJoinParts; }
  // One of several parts, and nothing else.
  bool One() const { return !part.empty() && !Join(); }
};

struct PartNumber {
  int number = 1, parts = 1;
};

// Of "K/N", K from 1 to N. Throws Error(kUsage) for what is not such a text.
PartNumber ParsePart(const std::string& text);

}  // namespace regrade
