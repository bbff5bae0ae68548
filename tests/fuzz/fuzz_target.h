// A fuzz target: a reader, inputs that it must accept, and mutations that pass its first
// checks.
#pragma once

#include <cstdint>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include "kernels/base/random.h"

namespace regrade::testing {

// Random numbers that depend on the seed only.
class FuzzRandom {
 public:
  explicit FuzzRandom(uint64_t seed) : seed_(seed) {}
  uint64_t Bits() { return RandomBits(seed_, 55, counter_++); }
  // In {0, ..., n - 1}; n >= 1.
  size_t Below(size_t n) { return static_cast<size_t>(RandomIndex(seed_, 56, counter_++, n)); }
  bool Chance(double share) { return RandomDouble(seed_, 57, counter_++) < share; }

 private:
  uint64_t seed_, counter_ = 0;
};

struct FuzzTarget {
  const char* name;
  // The first inputs of the corpus; they must be accepted.
  std::vector<std::string> (*seeds)();
  // Runs the reader. True if it accepted the bytes and its guarantees hold, false if it threw
  // an Error. Any exception is a finding.
  bool (*read)(std::string_view bytes);
  // One mutant.
  std::string (*mutate)(std::string bytes, FuzzRandom* random);
  int mutants = 12000;  // in the replay test: about half a second
};

inline std::ostream& operator<<(std::ostream& out, const FuzzTarget& target) {
  return out << target.name;
}

// By kind of file; each list is in the file of its name.
std::vector<FuzzTarget> ArchiveTargets();
std::vector<FuzzTarget> BundleTargets();
std::vector<FuzzTarget> ColmapTargets();
std::vector<FuzzTarget> CommandLineTargets();
std::vector<FuzzTarget> CubeTargets();
std::vector<FuzzTarget> FieldTargets();
std::vector<FuzzTarget> FlowTargets();
std::vector<FuzzTarget> JsonTargets();
std::vector<FuzzTarget> PageTargets();
std::vector<FuzzTarget> PictureTargets();
std::vector<FuzzTarget> PoseTableTargets();
std::vector<FuzzTarget> RecordTargets();
std::vector<FuzzTarget> RequestTargets();
std::vector<FuzzTarget> SplatTargets();
std::vector<FuzzTarget> StateTargets();

template <typename... Lists>
std::vector<FuzzTarget> Joined(Lists... lists) {
  std::vector<FuzzTarget> all;
  for (const auto list : {lists...})
    for (const FuzzTarget& target : list()) all.push_back(target);
  return all;
}

// Readers that link few libraries, and the others.
inline std::vector<FuzzTarget> ReaderTargets() {
  return Joined(BundleTargets, ColmapTargets, CubeTargets, ArchiveTargets, FieldTargets,
                JsonTargets, PoseTableTargets, PictureTargets, SplatTargets);
}
inline std::vector<FuzzTarget> ProgramTargets() {
  return Joined(RecordTargets, PageTargets, RequestTargets, FlowTargets, StateTargets,
                CommandLineTargets);
}

}  // namespace regrade::testing
