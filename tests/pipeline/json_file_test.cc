#include "pipeline/files/json_file.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/support/expect_error.h"

namespace regrade {
namespace {

TEST(Json, KeepsOrderAndPositions) {
  const JsonValue value = ParseJson("{\n \"b\": 1,\n \"a\": [true, null, \"x\"]}", "text");
  EXPECT_EQ(value.AsObject()[0].first, "b");
  EXPECT_EQ(value.At("a").line(), 3);
  EXPECT_EQ(DumpJson(value, -1), R"({"b":1,"a":[true,null,"x"]})");
}

TEST(Json, NumbersReadBackExactly) {
  for (const double number : {0.1, 1e-310, 1.7976931348623157e308, -0.0, 1.0 / 3}) {
    const JsonValue value = ParseJson(DumpJson(JsonValue(number), -1), "text");
    EXPECT_EQ(value.AsDouble(), number);
  }
  EXPECT_EQ(ParseJson("18446744073709551615", "text"), JsonValue(~uint64_t{0}));
  EXPECT_EQ(DumpJson(JsonValue(std::numeric_limits<double>::quiet_NaN()), -1), "null");
}

TEST(Json, F75_DepthIsLimited) {
  const std::string fits = std::string(64, '[') + std::string(64, ']');
  EXPECT_NO_THROW(ParseJson(fits, "text"));
  EXPECT_REGRADE_ERROR(ParseJson("\n[" + fits + "]", "text"), ExitCode::kInput, "text:2:65");
  // Deeper than the stack.
  EXPECT_REGRADE_ERROR(ParseJson(std::string(1000000, '['), "text"), ExitCode::kInput,
                       "64 levels");
}

TEST(Json, F75_DuplicateKeysNameTheirLine) {
  EXPECT_REGRADE_ERROR(ParseJson("{\"a\": {\"k\": 1,\n\n  \"k\": 2}}", "f.json"),
                       ExitCode::kInput, "f.json:3:5");
  EXPECT_NO_THROW(ParseJson(R"({"a": {"k": 1}, "b": {"k": 1}})", "text"));
}

TEST(Json, F75_SyntaxNamesLineAndColumn) {
  EXPECT_REGRADE_ERROR(ParseJson("{\n  \"a\": oops\n}", "f.json", ExitCode::kUsage),
                       ExitCode::kUsage, "f.json:2:8");
}

TEST(Json, F75_HostileText) {
  for (const char* text :
       {"", "1e999", "-1e999", "\"\\ud800\"", "\"\xff\"", "\"\xc0\xaf\"", "[1,]", "{\"a\":1}x",
        "nul", "\"\n\"", "{1:2}", "[1 2]", "\"\\x41\"", "01", "+1", ".5", "NaN", "/*c*/1"})
    EXPECT_REGRADE_ERROR(ParseJson(text, "text"), ExitCode::kInput, "text:");
}

TEST(Json, F22_ByteOrderMarkAndCarriageReturns) {
  EXPECT_EQ(ParseJson("\xef\xbb\xbf{\r\n\"a\":\r\n1}\r\n", "text").At("a").AsInt(), 1);
}

TEST(Json, WrongKindsNameTheLine) {
  const JsonValue value = ParseJson("{\n\"a\": \"x\"}", "text");
  EXPECT_REGRADE_ERROR(value.At("a").AsDouble(), ExitCode::kInput, "line 2");
  EXPECT_REGRADE_ERROR(value.At("b"), ExitCode::kInput, "\"b\" is missing");
  EXPECT_REGRADE_ERROR(ParseJson("1.5", "text").AsInt(), ExitCode::kInput, "whole number");
}

}  // namespace
}  // namespace regrade
