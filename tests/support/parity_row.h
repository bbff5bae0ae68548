// One row of the parity table, for people and for scripts.
#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <string>

namespace regrade::testing {

inline void ParityRow(const char* body, const std::string& what, const char* against,
                      double error, double tolerance) {
  std::printf("parity\t%s\t%s\t%s\t%.3g\t%.3g\n", body, what.c_str(), against, error,
              tolerance);
  EXPECT_LE(error, tolerance) << body << " (" << what << ") against " << against;
}

}  // namespace regrade::testing
