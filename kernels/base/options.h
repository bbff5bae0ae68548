// Options that describe themselves: name, default, unit, bounds and effect are written once,
// beside the member, and become command-line flag, help text, run.json entry and range check.
//
//   struct FitOptions {
//     float step = 0.5f;
//     template <typename Bind>
//     void Describe(Bind& bind) {
//       bind("fit-step", step, {.unit = "voxels", .help = "distance of samples on a ray; 1
//       halves the time",
//                               .min = 0.1, .max = 4});
//     }
//   };
//
// A member is bool, int, int64_t, uint64_t, float, double, std::string, std::vector<int> (one
// flag, values separated by commas) or std::vector<std::string> (a flag for each value).
#pragma once

#include <limits>

namespace regrade {

struct OptionInfo {
  const char* unit = "";
  const char* help = "";
  double min = -std::numeric_limits<double>::infinity();  // inclusive; numbers only
  double max = std::numeric_limits<double>::infinity();
  // For strings: "a|b|c"; "|a|b|c" allows an empty text, too, and "" anything.
  const char* choices = "";
  bool may_be_empty = false;  // of a list of numbers

  // Texts that lead out of a run's folder. Of a command that continues a folder, which may come
  // from somebody else, its run.json alone is not enough for them. Each is a list of beginnings
  // with "|" between: "*" is any text but an empty one, "!TEXT" an exception. What is only
  // looked at as a picture (--style) is not among them, nor what stages pose and reconstruct
  // alone use: no such command runs those.
  const char* runs = "";   // programs, and networks
  const char* reads = "";  // files and folders; those in the run's folder are its own
  bool once = false;       // of one start: not taken from a run's folder
  // No flag of a command that has --config, which alone changes it there, for measurements.
  bool constant = false;
};

}  // namespace regrade
