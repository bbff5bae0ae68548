// --match: several style pictures as one style.
#pragma once

#include <string>
#include <string_view>

#include "kernels/base/options.h"

namespace regrade {

struct MatchChoice {
  std::string match = "none";

  bool On() const { return match != "none"; }
  // The file of regions:FILE, or nothing.
  std::string Network() const {
    return match.starts_with(kWith) ? match.substr(kWith.size()) : "";
  }
  void SetNetwork(const std::string& path) { match = std::string(kWith) + path; }
  bool IsKnown() const { return !On() || match == "regions" || !Network().empty(); }

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("match", match,
         {.help =
              "with several style pictures: none makes a style of each; regions makes one "
              "of all, in which a region of the scene takes the picture that has a region "
              "like it, by colour and height in the picture; where that is not clear, the "
              "program says so and asks for masks. regions:FILE also compares features of an "
              "ONNX network (input \"image\", output \"feat\")",
          .runs = "regions:"});
  }

 private:
  static constexpr std::string_view kWith = "regions:";
};

}  // namespace regrade
