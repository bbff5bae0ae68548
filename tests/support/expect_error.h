// EXPECT that a statement throws Error with a code, and that its message contains a text.
#pragma once

#include <gtest/gtest.h>

#include "kernels/base/error.h"

#define EXPECT_REGRADE_ERROR(statement, expected_code, part_of_message)             \
  do {                                                                              \
    try {                                                                           \
      statement;                                                                    \
      ADD_FAILURE() << #statement " did not throw";                                 \
    } catch (const ::regrade::Error& error) {                                       \
      EXPECT_EQ(static_cast<int>(error.code()), static_cast<int>(expected_code))    \
          << error.what();                                                          \
      EXPECT_NE(std::string(error.what()).find(part_of_message), std::string::npos) \
          << error.what();                                                          \
    }                                                                               \
  } while (false)
