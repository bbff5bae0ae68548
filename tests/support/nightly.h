// Tests that are too long for each change.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>

// Skips the test that it begins, but for scripts/nightly.sh.
#define REGRADE_AT_NIGHT() \
  if (std::getenv("REGRADE_NIGHTLY") == nullptr) GTEST_SKIP() << "scripts/nightly.sh runs it"
