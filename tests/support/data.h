// The folder of real captures for tests: REGRADE_DATA, or ../shared/data beside the source
// tree. Tests skip without it.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

#include "tests/support/source_dir.h"

namespace regrade::testing {

inline std::string DataRoot() {
  if (const char* root = std::getenv("REGRADE_DATA")) return root;
  return SourceDir() + "/../shared/data";
}

inline std::string DataPath(const std::string& relative) { return DataRoot() + "/" + relative; }

inline bool HaveData(const std::string& relative) {
  return std::filesystem::exists(DataPath(relative));
}

}  // namespace regrade::testing

#define REGRADE_NEED_DATA(relative)                                            \
  if (!::regrade::testing::HaveData(relative))                                 \
  GTEST_SKIP() << "no test data at " << ::regrade::testing::DataPath(relative) \
               << " (set REGRADE_DATA)"
