#include "evaluate/paired_difference.h"

#include <gtest/gtest.h>

#include <limits>

namespace regrade {
namespace {

// Both sequences find the same pairs difficult: the difference of each pair is the same.
TEST(PairedDifference, IsOfTheSameFrames) {
  ConsistencyReport report;
  const double hard[] = {30, 20, 35, 22, 31, 24, 33, 21};
  for (int i = 0; i < 8; ++i) {
    PairResult pair;
    pair.from = i;
    pair.to = i + 1;
    pair.sequence = "styled";
    pair.psnr_db = hard[i];
    report.pairs.push_back(pair);
    pair.sequence = "styled_2";
    pair.psnr_db = hard[i] - 1.5;
    if (i == 3) pair.psnr_db = std::numeric_limits<double>::infinity();
    if (i == 5) pair.psnr_db.reset();
    report.pairs.push_back(pair);
  }
  for (const char* name : {"styled", "styled_2"}) {
    ConsistencyRow row;
    row.sequence = name;
    row.gap = 1;
    report.rows.push_back(row);
  }
  AddDifferences("styled", &report);
  EXPECT_FALSE(report.rows[0].difference);
  const PairedDifference& difference = report.rows[1].difference.value();
  EXPECT_EQ(difference.pairs, 6);
  EXPECT_NEAR(*difference.mean, -1.5, 1e-12);
  EXPECT_NEAR(difference.interval->low, -1.5, 1e-12);
  EXPECT_NEAR(difference.interval->high, -1.5, 1e-12);
}

}  // namespace
}  // namespace regrade
