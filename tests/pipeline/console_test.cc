#include "pipeline/program/console.h"

#include <gtest/gtest.h>

#include "kernels/base/random.h"
#include "pipeline/program/eta_estimator.h"

namespace regrade {
namespace {

TEST(Printable, ControlBytesAreEscaped) {
  EXPECT_EQ(Printable("a\nb\x1b[31m\x7f"), "a\\x0ab\\x1b[31m\\x7f");
  EXPECT_EQ(Printable("h\xc3\xa9llo \xe2\x82\xac \xf0\x9f\x93\xb7"),
            "h\xc3\xa9llo \xe2\x82\xac \xf0\x9f\x93\xb7");
  EXPECT_EQ(Printable("\xff\xc3("), "\\xff\\xc3(");
  EXPECT_EQ(Printable("\xc2\x9b"
                      "31m"),
            "\\xc2\\x9b31m");  // an escape sequence in one character
  EXPECT_EQ(Printable("\xc0\xaf \xed\xa0\x80"), "\\xc0\\xaf \\xed\\xa0\\x80");
  EXPECT_EQ(Printable("\xe2\x82"), "\\xe2\\x82");
}

TEST(MessageFor, IsOneLine) {
  EXPECT_EQ(MessageFor(Error(ExitCode::kInput, "empty file", "a\nb.jpg", "remove it"), "pose"),
            "a\\x0ab.jpg: empty file. To do: remove it. Kept: pose");
}

// What another program printed keeps its lines, and steers no terminal.
TEST(MessageFor, KeepsIndentedLines) {
  const Error error(ExitCode::kExternalProgram, "failed:\n  one\n  two\x1b[31m\nthree",
                    "x\n  y");
  EXPECT_EQ(MessageFor(error, ""), "x\\x0a  y: failed:\n  one\n  two\\x1b[31m\\x0athree");
}

TEST(DurationText, ReadsWell) {
  EXPECT_EQ(DurationText(8.4), "8 s");
  EXPECT_EQ(DurationText(61), "1 min 01 s");
  EXPECT_EQ(DurationText(7400), "2 h 03 min");
}

// Worst ratio of estimated and true seconds left after the first fifth; `cost(i)` is the time
// of step i of 1000.
template <typename Cost>
double WorstFactor(const Cost& cost) {
  constexpr int kSteps = 1000;
  double total = 0;
  for (int i = 0; i < kSteps; ++i) total += cost(i);
  EtaEstimator eta;
  double now = 0, worst = 1;
  for (int i = 0; i < kSteps; ++i) {
    now += cost(i);
    eta.Add(now, i + 1, kSteps);
    if (i < kSteps / 5 || i > kSteps * 98 / 100) continue;
    const double truth = total - now, estimate = eta.Remaining().value();
    worst = std::max({worst, truth / estimate, estimate / truth});
  }
  return worst;
}

TEST(EtaEstimator, WithinAFactorOfTwoAfterTheFirstFifth) {
  EXPECT_LT(WorstFactor([](int) { return 0.1; }), 1.01);
  // Steps that differ by ten.
  EXPECT_LT(WorstFactor([](int i) { return 0.02 + 0.2 * RandomDouble(1, 2, i); }), 2);
  // A slow start.
  EXPECT_LT(WorstFactor([](int i) { return i < 100 ? 1.0 : 0.1; }), 2);
  // Steps that grow to three times their cost, as a scene gets denser.
  EXPECT_LT(WorstFactor([](int i) { return 0.1 + 0.2 * i / 1000; }), 2);
  // Occasional pauses for a checkpoint.
  EXPECT_LT(WorstFactor([](int i) { return i % 100 == 99 ? 3.0 : 0.1; }), 2);
}

TEST(EtaEstimator, PreparationsAreIgnored) {
  EtaEstimator eta;
  eta.Add(6, 1, 300);  // six seconds of preparations and a step
  EXPECT_FALSE(eta.Remaining());
  eta.Add(6.1, 2, 300);
  EXPECT_NEAR(eta.Remaining().value(), 29.8, 0.1);
}

// What is left of a command: 60 s are expected of this stage and 300 s of what follows.
TEST(LeftInAll, FollowsThePaceWithoutBelievingAShortStage) {
  const ExpectedTime expected{.current = 60, .later = 300};
  // As expected, half done.
  EXPECT_NEAR(LeftInAll(expected, 0, 30, 30), 330, 1e-9);
  // A stage of 60 s that takes ten times as long says little of the other 300.
  EXPECT_LT(LeftInAll(expected, 0, 300, 300), 300 + 4 * 300);
  EXPECT_GT(LeftInAll(expected, 0, 300, 300), 300 + 2 * 300);
  // Most of the work took twice its time.
  EXPECT_NEAR(LeftInAll({.finished = 300, .current = 30, .later = 30}, 600, 30, 30),
              30 + 30 * 1.65, 2);
  EXPECT_EQ(LeftInAll({}, 0, 5, 7), 7);
}

TEST(Counted, HasOneOrMore) {
  EXPECT_EQ(Counted(1, "clip"), "1 clip");
  EXPECT_EQ(Counted(0, "clip"), "0 clips");
  EXPECT_EQ(Counted(2, "body", "bodies"), "2 bodies");
}

TEST(EtaEstimator, EmptyWithoutData) {
  EtaEstimator eta;
  EXPECT_FALSE(eta.Remaining());
  eta.Add(0.5, 1, 10);
  EXPECT_FALSE(eta.Remaining());  // too early
  eta.Add(5, 1, 0);
  EXPECT_FALSE(eta.Remaining());  // no total
  eta.Add(6, 2, 10);
  EXPECT_TRUE(eta.Remaining());
  eta.Add(7, 0, 10);  // restarted
  EXPECT_FALSE(eta.Remaining());
}

}  // namespace
}  // namespace regrade
