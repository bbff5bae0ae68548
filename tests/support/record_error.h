// What a test of numbers has measured, beside what it allows: properties of the test in
// GoogleTest's report, which scripts/hard_cases.py --measured gathers.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <string>

namespace regrade::testing {

enum class Computed { kFloat, kDouble, kGpu };  // kGpu: in float, on the card

// Of all that is measured under one name in one test the worst is kept.
inline void Record(const char* kind, const std::string& what, Computed computed,
                   double measured, double allowed) {
  static std::map<std::string, double> worst;
  const ::testing::TestInfo* test = ::testing::UnitTest::GetInstance()->current_test_info();
  const std::string key =
      std::string(test->test_suite_name()) + "." + test->name() + " " + what;
  // Allowed 0: nothing but the same bits, and then the difference itself says how far it is.
  const double share = std::abs(measured) / (allowed > 0 ? allowed : 1);
  const auto [place, first] = worst.try_emplace(key, share);
  if (!first && share <= place->second) return;
  place->second = share;
  char text[96];
  const char* format = std::string(kind) == "count" ? "%s %s %.0f %.0f" : "%s %s %.2e %.2e";
  std::snprintf(text, sizeof text, format, kind,
                computed == Computed::kFloat    ? "float CPU"
                : computed == Computed::kDouble ? "double CPU"
                                                : "float GPU",
                std::abs(measured), allowed);
  ::testing::Test::RecordProperty("measured: " + what, text);
}

// An error over `scale`, the size of what it is an error of: it is told in decimal digits.
// Returns the error that is allowed, for the assertion that it stands in.
inline double RecordDigits(const std::string& what, Computed computed, double error,
                           double allowed, double scale = 1) {
  if (scale > 0) Record("digits", what, computed, error / scale, allowed);
  return allowed * scale;
}

// Something else that stays below a bound: a share, a distance, a steepness.
inline double RecordBound(const std::string& what, Computed computed, double measured,
                          double allowed) {
  Record("bound", what, computed, measured, allowed);
  return allowed;
}

// How many there were of something.
inline void RecordCount(const std::string& what, double count) {
  Record("count", what, Computed::kDouble, count, 0);
}

// Two results that are the same to the last bit. Returns what it is told, for EXPECT_TRUE.
inline bool RecordSameBits(const std::string& what, Computed computed, bool same) {
  Record("bits", what, computed, same ? 0 : 1, 0);
  return same;
}

}  // namespace regrade::testing
