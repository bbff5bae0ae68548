// Prints and checks one row of the parity table (CPU against GPU).
#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <string>

#include "tests/support/record_error.h"

namespace regrade::testing {

inline void ParityRow(const char* body, const std::string& what, const char* against,
                      double error, double tolerance) {
  std::printf("parity\t%s\t%s\t%s\t%.3g\t%.3g\n", body, what.c_str(), against, error,
              tolerance);
  EXPECT_LE(error, RecordBound(std::string(body) + " against " + against, Computed::kGpu, error,
                               tolerance))
      << body << " (" << what << ") against " << against;
}

}  // namespace regrade::testing
