// Entry point of libFuzzer: one program for all targets.
//
//   fuzz_readers --list                       their names
//   fuzz_readers --target=NAME --seeds=DIR    writes the seeds and ends
//   fuzz_readers --target=NAME [libFuzzer's flags and folders]
#include <omp.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

using regrade::testing::FuzzRandom;
using regrade::testing::FuzzTarget;

const FuzzTarget* chosen = nullptr;

const char* ValueOf(const char* word, const char* flag) {
  const size_t length = std::strlen(flag);
  return std::strncmp(word, flag, length) == 0 ? word + length : nullptr;
}

}  // namespace

extern "C" size_t LLVMFuzzerMutate(uint8_t* data, size_t size, size_t max_size);

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  static const std::vector<FuzzTarget> all = [] {
    using namespace regrade::testing;
    std::vector<FuzzTarget> targets = ReaderTargets();
    for (const FuzzTarget& target : ProgramTargets()) targets.push_back(target);
    return targets;
  }();
  omp_set_num_threads(1);
  const char* seeds = nullptr;
  for (int i = 1; i < *argc; ++i) {
    if (std::strcmp((*argv)[i], "--list") == 0) {
      for (const FuzzTarget& target : all) std::printf("%s\n", target.name);
      std::exit(0);
    }
    if (const char* name = ValueOf((*argv)[i], "--target="))
      for (const FuzzTarget& target : all)
        if (std::strcmp(target.name, name) == 0) chosen = &target;
    if (const char* folder = ValueOf((*argv)[i], "--seeds=")) seeds = folder;
  }
  if (chosen == nullptr) {
    std::fprintf(stderr, "fuzz_readers: --target=NAME with a name of --list is needed\n");
    std::exit(2);
  }
  const std::vector<std::string> inputs = chosen->seeds();
  for (size_t i = 0; seeds != nullptr && i < inputs.size(); ++i)
    regrade::testing::WriteText(std::string(seeds) + "/seed_" + std::to_string(i), inputs[i]);
  if (seeds != nullptr) std::exit(0);
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  chosen->read({reinterpret_cast<const char*>(data), size});
  return 0;
}

// Mixes the library's mutations, which use coverage, with ours, which use the format.
extern "C" size_t LLVMFuzzerCustomMutator(uint8_t* data, size_t size, size_t max_size,
                                          unsigned int seed) {
  FuzzRandom random(seed);
  if (random.Chance(0.25)) return LLVMFuzzerMutate(data, size, max_size);
  std::string mutant =
      chosen->mutate(std::string(reinterpret_cast<const char*>(data), size), &random);
  mutant.resize(std::min(mutant.size(), max_size));
  std::memcpy(data, mutant.data(), mutant.size());
  return mutant.size();
}
