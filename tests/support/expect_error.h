// Errors that are expected.
#pragma once

#include <gtest/gtest.h>

#include <initializer_list>
#include <string>

#include "kernels/base/error.h"

namespace regrade::testing {

// The error that `body` throws; one of kDone if it returns.
template <typename Body>
Error ErrorFrom(const Body& body) {
  try {
    body();
  } catch (const Error& error) {
    return error;
  }
  return Error(ExitCode::kDone, "");
}

}  // namespace regrade::testing

// EXPECT that a statement throws Error with a code, and that its message contains each of some
// texts.
#define EXPECT_REGRADE_ERROR(statement, expected_code, ...)                                    \
  do {                                                                                         \
    try {                                                                                      \
      statement;                                                                               \
      ADD_FAILURE() << #statement " did not throw";                                            \
    } catch (const ::regrade::Error& error) {                                                  \
      EXPECT_EQ(static_cast<int>(error.code()), static_cast<int>(expected_code))               \
          << error.what();                                                                     \
      for (const std::string& expected_part : std::initializer_list<std::string>{__VA_ARGS__}) \
        EXPECT_NE(std::string(error.what()).find(expected_part), std::string::npos)            \
            << error.what();                                                                   \
    }                                                                                          \
  } while (false)
