// Records what a test measured and what it allows as properties of the test in GoogleTest's
// report, which scripts/hard_cases.py prints.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <string>

namespace regrade::testing {

enum class Computed { kFloat, kDouble, kGpu };  // kGpu: in float, on the card

// Keeps the worst of all values that one test records under one name.
inline void Record(const char* kind, const std::string& what, Computed computed,
                   double measured, double allowed) {
  static std::map<std::string, double> worst;
  const ::testing::TestInfo* test = ::testing::UnitTest::GetInstance()->current_test_info();
  const std::string key =
      std::string(test->test_suite_name()) + "." + test->name() + " " + what;
  // If 0 is allowed, only equal bits pass, and the difference itself is compared.
  const double fraction = std::abs(measured) / (allowed > 0 ? allowed : 1);
  const auto [place, first] = worst.try_emplace(key, fraction);
  if (!first && fraction <= place->second) return;
  place->second = fraction;
  char text[96];
  const char* format = std::string(kind) == "count" ? "%s %s %.0f %.0f" : "%s %s %.2e %.2e";
  std::snprintf(text, sizeof text, format, kind,
                computed == Computed::kFloat    ? "float CPU"
                : computed == Computed::kDouble ? "double CPU"
                                                : "float GPU",
                std::abs(measured), allowed);
  ::testing::Test::RecordProperty("measured: " + what, text);
}

// A relative error, of `error` over `scale`, reported in decimal digits. Returns the allowed
// absolute error, for the assertion around it.
inline double RecordDigits(const std::string& what, Computed computed, double error,
                           double allowed, double scale = 1) {
  if (scale > 0) Record("digits", what, computed, error / scale, allowed);
  return allowed * scale;
}

// Another number with an upper limit: a fraction, a distance, a Lipschitz constant.
inline double RecordBound(const std::string& what, Computed computed, double measured,
                          double allowed) {
  Record("bound", what, computed, measured, allowed);
  return allowed;
}

// A number of inputs.
inline void RecordCount(const std::string& what, double count) {
  Record("count", what, Computed::kDouble, count, 0);
}

// Whether two results are bitwise equal. Returns `same`, for EXPECT_TRUE.
inline bool RecordSameBits(const std::string& what, Computed computed, bool same) {
  Record("bits", what, computed, same ? 0 : 1, 0);
  return same;
}

}  // namespace regrade::testing
