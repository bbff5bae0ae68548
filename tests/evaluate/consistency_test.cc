#include "evaluate/consistency.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <filesystem>
#include <limits>

#include "evaluate/flow_file.h"
#include "evaluate/optical_flow.h"
#include "kernels/base/error.h"
#include "tests/evaluate/synthetic_frames.h"
#include "tests/support/expect_error.h"
#include "tests/support/record_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using namespace regrade::testing;

constexpr int kW = 24, kH = 16;

PairMotionFunction Still(float weight = 1) {
  return [=](int, int) { return StillMotion(kW, kH, weight); };
}

ConsistencyOptions Gaps(std::vector<int> gaps) { return {.gaps = std::move(gaps)}; }

FrameSource Levels(std::vector<float> levels) {
  std::vector<Image> images;
  for (const float level : levels) images.push_back(ConstantImage(kW, kH, level));
  return Frames(std::move(images));
}

TEST(Consistency, H111_EmptyMaskIsUndefinedAndCounted) {
  const auto motion = [](int i, int) { return StillMotion(kW, kH, i == 1 ? 0.f : 1.f); };
  const auto report =
      EvaluateConsistency(4, motion, {{"s", Levels({0, 0.1f, 0.2f, 0.3f})}}, Gaps({1}));
  const ConsistencyRow& row = report.rows.at(0);
  EXPECT_EQ(row.pairs, 3);
  EXPECT_EQ(row.undefined_pairs, 1);
  EXPECT_FALSE(report.pairs.at(1).error || report.pairs.at(1).psnr_db);
  EXPECT_NEAR(*row.tc_psnr_mean_db, 20, 1e-4);     // the undefined pair has no influence
  EXPECT_NEAR(*row.tc_psnr_of_mean_db, 20, 1e-4);  // it does not count as an error of 0
  EXPECT_NEAR(row.coverage, 2.0 / 3, 1e-12);

  const auto none = EvaluateConsistency(2, Still(0), {{"s", Levels({0, 1})}}, Gaps({1}));
  EXPECT_FALSE(none.rows.at(0).tc_psnr_mean_db || none.rows.at(0).tc_psnr_of_mean_db);
  EXPECT_FALSE(none.rows.at(0).why.empty());
}

TEST(Consistency, H112_IdenticalFramesAreInfiniteAndOutOfTheMean) {
  const auto report =
      EvaluateConsistency(3, Still(), {{"s", Levels({0.5f, 0.5f, 0.6f})}}, Gaps({1}));
  EXPECT_EQ(*report.pairs.at(0).error, 0);
  EXPECT_TRUE(std::isinf(*report.pairs.at(0).psnr_db) && *report.pairs.at(0).psnr_db > 0);
  EXPECT_EQ(report.rows.at(0).perfect_pairs, 1);
  EXPECT_EQ(report.rows.at(0).undefined_pairs, 0);
  EXPECT_NEAR(*report.rows.at(0).tc_psnr_mean_db, 20, 1e-4);

  const auto all = EvaluateConsistency(2, Still(), {{"s", Levels({0.5f, 0.5f})}}, Gaps({1}));
  EXPECT_FALSE(all.rows.at(0).tc_psnr_mean_db);
  EXPECT_TRUE(std::isinf(*all.rows.at(0).tc_psnr_of_mean_db));
  EXPECT_FALSE(all.rows.at(0).why.empty());
}

TEST(Consistency, H113_BothMeansAreReported) {
  // Errors 0 (identical), 0.01 and 0.0001.
  const auto report =
      EvaluateConsistency(4, Still(), {{"s", Levels({0.25f, 0.25f, 0.35f, 0.36f})}}, Gaps({1}));
  const ConsistencyRow& row = report.rows.at(0);
  EXPECT_NEAR(*row.tc_psnr_mean_db, 30, 1e-4);
  const double of_mean = -10 * std::log10(0.0101 / 3);
  EXPECT_NEAR(*row.tc_psnr_of_mean_db, of_mean,
              testing::RecordBound("decibels of the mean", testing::Computed::kDouble,
                                   *row.tc_psnr_of_mean_db - of_mean, 1e-4));

  const auto jensen =
      EvaluateConsistency(3, Still(), {{"s", Levels({0.25f, 0.35f, 0.36f})}}, Gaps({1}));
  EXPECT_GT(*jensen.rows.at(0).tc_psnr_mean_db, *jensen.rows.at(0).tc_psnr_of_mean_db + 5);
}

TEST(Consistency, H114_ErrorIsPerPixelAndChannel) {
  Image later = ConstantImage(kW, kH, 0.5f);
  for (int i = 0; i < kW * kH; ++i) later.pixels[3 * i] = 0.6f;
  const PairResult pair = ComparePair(ConstantImage(kW, kH, 0.5f), later, StillMotion(kW, kH));
  EXPECT_NEAR(*pair.error, 0.01 / 3,
              testing::RecordBound("squared error of one channel", testing::Computed::kDouble,
                                   *pair.error - 0.01 / 3,
                                   1e-8));  // summed over channels it would be 4.77 dB lower
  // An alpha channel is not a colour; grey has one channel.
  EXPECT_NEAR(*ComparePair(ConstantImage(kW, kH, 0.5f, 1), ConstantImage(kW, kH, 0.6f, 1),
                           StillMotion(kW, kH))
                   .error,
              0.01, 1e-8);
  Image a = ConstantImage(kW, kH, 0.5f, 4), b = a;
  for (int i = 0; i < kW * kH; ++i) b.pixels[4 * i + 3] = 0;
  EXPECT_EQ(*ComparePair(a, b, StillMotion(kW, kH)).error, 0);
}

// A step to the right by 2 px: the positions that are compared, and the frame that is sampled
// between pixels, differ by direction.
TEST(Consistency, TheWarpedFrameIsTheOneAskedFor) {
  const int shift = 2;
  const auto motion = [](int from, int to) {
    PairMotion still = StillMotion(kW, kH);
    for (int y = 0; y < kH; ++y)
      for (int x = 0; x < kW; ++x)
        still.flow.at(x, y)[0] = static_cast<float>(to > from ? shift : -shift);
    // Only the left column of the frame in which the two are compared counts.
    for (int y = 0; y < kH; ++y)
      for (int x = 1; x < kW; ++x) *still.mask.weight.at(x, y) = 0;
    return still;
  };
  Image earlier = ConstantImage(kW, kH, 0), later = ConstantImage(kW, kH, 0.5f);
  for (int y = 0; y < kH; ++y)
    for (int c = 0; c < 3; ++c) {
      later.at(shift, y)[c] = 0.1f;  // what the earlier frame's left column moves to
      later.at(0, y)[c] = 0.2f;      // comes from outside the earlier frame: its border
    }
  const std::vector<NamedFrameSource> frames{{"s", Frames({earlier, later})}};
  ConsistencyOptions options = Gaps({1});
  EXPECT_NEAR(*EvaluateConsistency(2, motion, frames, options).pairs.at(0).error, 0.01, 1e-8);
  options.warp = "earlier";
  const ConsistencyReport report = EvaluateConsistency(2, motion, frames, options);
  EXPECT_NEAR(*report.pairs.at(0).error, 0.04, 1e-8);
  EXPECT_EQ(report.pairs.at(0).from, 0);
  EXPECT_EQ(report.worst.at(0).at, 1);
  EXPECT_EQ(report.worst.at(0).warped, 0);
}

TEST(Consistency, H114_ErrorPerPixelIsTheSumOverChannels) {
  ConsistencyOptions options = Gaps({1});
  const std::vector<NamedFrameSource> colour{{"s", Levels({0.25f, 0.35f})}};
  const PairResult channel = EvaluateConsistency(2, Still(), colour, options).pairs.at(0);
  options.error_per = "pixel";
  const PairResult pixel = EvaluateConsistency(2, Still(), colour, options).pairs.at(0);
  EXPECT_NEAR(*pixel.error, 3 * *channel.error, 1e-12);
  EXPECT_NEAR(*channel.psnr_db - *pixel.psnr_db, 10 * std::log10(3.0), 1e-9);
  // A grey frame has one channel.
  const std::vector<NamedFrameSource> grey{
      {"s", Frames({ConstantImage(kW, kH, 0.25f, 1), ConstantImage(kW, kH, 0.35f, 1)})}};
  EXPECT_NEAR(*EvaluateConsistency(2, Still(), grey, options).pairs.at(0).error, 0.01, 1e-8);
  // What 8 bits resolve does not depend on how the error is counted: 60 dB a channel.
  const std::vector<NamedFrameSource> fine{{"s", Levels({0.25f, 0.251f})}};
  EXPECT_EQ(EvaluateConsistency(2, Still(), fine, options).rows.at(0).pairs_above_8bit_floor,
            1);
}

TEST(Consistency, ForwardWarpingRefusesTheSwitches) {
  const FrameSource frames = Levels({0, 0.1f});
  for (const bool direction : {false, true}) {
    ConsistencyOptions options = Gaps({1});
    options.mode = "stylegaussian";
    (direction ? options.warp : options.error_per) = direction ? "earlier" : "pixel";
    EXPECT_REGRADE_ERROR(EvaluateConsistency(frames, {{"s", frames}}, options),
                         ExitCode::kUsage);
  }
}

TEST(Consistency, H115_PairsAboveThe8BitFloorAreCounted) {
  // A step of 1/1000 is 60 dB, of 1/500 54 dB; 8 bits resolve up to 58.9 dB.
  const auto report =
      EvaluateConsistency(3, Still(), {{"s", Levels({0.25f, 0.251f, 0.253f})}}, Gaps({1}));
  EXPECT_EQ(report.rows.at(0).pairs_above_8bit_floor, 1);
}

TEST(Consistency, H116_NonFiniteColoursAreExcludedAndCounted) {
  Image a = ConstantImage(kW, kH, 0.5f), b = ConstantImage(kW, kH, 0.6f);
  a.at(3, 3)[1] = kNan;
  b.at(9, 9)[0] = std::numeric_limits<float>::infinity();
  const PairResult pair = ComparePair(a, b, StillMotion(kW, kH));
  EXPECT_EQ(pair.colour_not_finite, 2);
  EXPECT_NEAR(*pair.error, 0.01,
              testing::RecordBound("error with non-finite colours", testing::Computed::kDouble,
                                   *pair.error - 0.01, 1e-8));
  EXPECT_NEAR(pair.coverage, 1 - 2.0 / (kW * kH), 1e-12);
}

// A flow of half a pixel mixes two columns: the one without a finite colour must be excluded.
TEST(Consistency, H117_EveryTapOfAWarpedColourMustBeFinite) {
  PairMotion motion = StillMotion(kW, kH);
  motion.flow = ConstantFlow(kW, kH, 0.5f, 0.5f);
  Image later = ConstantImage(kW, kH, 0.6f);
  later.at(10, 10)[2] = kNan;
  const PairResult pair = ComparePair(ConstantImage(kW, kH, 0.5f), later, motion);
  EXPECT_EQ(pair.colour_not_finite, 4);
  EXPECT_NEAR(*pair.error, 0.01,
              testing::RecordBound("error with a non-finite tap", testing::Computed::kDouble,
                                   *pair.error - 0.01, 1e-8));
}

TEST(Consistency, H118_LowCoverageIsFlagged) {
  const auto motion = [](int i, int) {
    PairMotion m = StillMotion(kW, kH);
    if (i == 0)
      for (int p = 0; p < kW * kH; ++p) m.mask.weight.pixels[p] = p % 25 == 0;
    return m;
  };
  const auto report = EvaluateConsistency(3, motion, {{"s", Levels({0, 1, 0})}}, Gaps({1}));
  EXPECT_TRUE(report.pairs.at(0).low_coverage);
  EXPECT_FALSE(report.pairs.at(1).low_coverage);
  EXPECT_EQ(report.rows.at(0).low_coverage_pairs, 1);
}

TEST(Consistency, H118_UnrelatedNoiseCoversLessThanOneSurface) {
  // Flow is always finite, and a tenth of it agrees in both directions by chance: the low
  // coverage and its threshold reveal it. Of small frames more does (0.4 of 96 x 96 pixels).
  const FrameSource noise = Frames({NoiseImage(192, 192, 1), NoiseImage(192, 192, 2)});
  const FrameSource waves = Frames({WaveImage(96, 96, 0, 0), WaveImage(96, 96, 2, 1)});
  for (const char* mode : {"lai2018", "ruder2016"}) {
    ConsistencyOptions options = Gaps({1});
    options.mode = mode;
    const auto row_of = [&](const FrameSource& frames) {
      return EvaluateConsistency(frames, {{"s", frames}}, options).rows.at(0);
    };
    EXPECT_LT(row_of(noise).coverage, 0.4) << mode;
    EXPECT_EQ(row_of(noise).low_coverage_pairs, 1) << mode;
    EXPECT_GT(row_of(waves).coverage, 0.8) << mode;
    EXPECT_EQ(row_of(waves).low_coverage_pairs, 0) << mode;
  }
}

TEST(Consistency, H120_MotionComesFromTheReferenceOnceForAllSequences) {
  std::vector<Image> waves, greys;
  for (int i = 0; i < 4; ++i) {
    waves.push_back(WaveImage(64, 48, 2 * i, i));
    greys.push_back(ConstantImage(64, 48, 0.5f));
  }
  const auto report = EvaluateConsistency(
      Frames(waves), {{"waves", Frames(waves)}, {"grey", Frames(greys)}}, Gaps({1, 2}));
  ASSERT_EQ(report.pairs.size(), 10u);
  for (size_t p = 0; p < report.pairs.size(); p += 2) {
    const PairResult &a = report.pairs[p], &b = report.pairs[p + 1];
    EXPECT_EQ(a.sequence, "waves");
    EXPECT_EQ(b.sequence, "grey");
    EXPECT_EQ(a.coverage, b.coverage);
    EXPECT_GT(a.coverage, 0.5);
    EXPECT_EQ(a.disoccluded, b.disoccluded);
    // The waves' own motion explains nearly all of the change; another motion would not.
    EXPECT_LT(*a.error,
              0.1 * *ComparePair(waves[static_cast<size_t>(a.from)],
                                 waves[static_cast<size_t>(a.to)], StillMotion(64, 48))
                         .error);
    EXPECT_EQ(*b.error, 0);  // grey is perfectly consistent for any flow
  }
  std::atomic<int> calls = 0;
  const auto counted = [&](int, int) {
    ++calls;
    return StillMotion(kW, kH);
  };
  const FrameSource levels = Levels({0, 1, 0});
  EvaluateConsistency(3, counted, {{"a", levels}, {"b", levels}, {"c", levels}}, Gaps({1, 2}));
  EXPECT_EQ(calls, 3);
}

TEST(Consistency, H121_GapsLongerThanTheSequenceAreUndefined) {
  const auto report =
      EvaluateConsistency(5, Still(), {{"s", Levels({0, 1, 0, 1, 0})}}, Gaps({1, 5}));
  EXPECT_EQ(report.rows.at(0).pairs, 4);
  const ConsistencyRow& far = report.rows.at(1);
  EXPECT_EQ(far.gap, 5);
  EXPECT_EQ(far.pairs, 0);
  EXPECT_FALSE(far.tc_psnr_mean_db || far.tc_psnr_of_mean_db);
  EXPECT_EQ(far.coverage, 0);
  EXPECT_NE(far.why.find("5"), std::string::npos);
  for (const int frames : {0, 1}) {
    const FrameSource few = Levels(std::vector<float>(frames, 0.5f));
    EXPECT_FALSE(EvaluateConsistency(few, {{"s", few}}, {}).rows.at(0).tc_psnr_mean_db);
  }
}

TEST(Consistency, H122_MismatchedSequencesAreClearErrors) {
  const FrameSource reference = Frames({WaveImage(40, 30, 0, 0), WaveImage(40, 30, 1, 0)});
  const FrameSource short_one = Frames({WaveImage(40, 30, 0, 0)});
  const FrameSource wide = Frames({WaveImage(41, 30, 0, 0), WaveImage(41, 30, 1, 0)});
  const FrameSource growing = Frames({WaveImage(40, 30, 0, 0), WaveImage(41, 30, 1, 0)});
  const FrameSource fading = Frames({WaveImage(40, 30, 0, 0), NoiseImage(40, 30, 1, 1)});
  for (const FrameSource& bad : {short_one, wide, growing, fading})
    EXPECT_REGRADE_ERROR(EvaluateConsistency(reference, {{"s", bad}}, {}), ExitCode::kInput);
  const FrameSource tiny = Frames({NoiseImage(8, 8, 1), NoiseImage(8, 8, 2)});
  EXPECT_REGRADE_ERROR(EvaluateConsistency(tiny, {{"s", tiny}}, {}), ExitCode::kInput);
  EXPECT_REGRADE_ERROR(EvaluateConsistency(reference, {{"s", reference}}, Gaps({0})),
                       ExitCode::kUsage);
  ConsistencyOptions options{.mode = "lai2019"};
  EXPECT_REGRADE_ERROR(EvaluateConsistency(reference, {{"s", reference}}, options),
                       ExitCode::kUsage);
  options.mode = "geometry";
  EXPECT_REGRADE_ERROR(EvaluateConsistency(reference, {{"s", reference}}, options),
                       ExitCode::kUsage);
}

TEST(Consistency, H123_SumsOfManyPixelsDoNotStall) {
  // 4 M equal terms of 0.01: summed one by one in float the result would be off by a quarter.
  const Image a = ConstantImage(2048, 2048, 0, 1), b = ConstantImage(2048, 2048, 0.1f, 1);
  const PairResult pair = ComparePair(a, b, StillMotion(2048, 2048));
  const double exact = static_cast<double>(0.1f) * 0.1f;
  EXPECT_NEAR(*pair.error, exact,
              testing::RecordDigits("mean over 4 million pixels", testing::Computed::kDouble,
                                    *pair.error - exact, 1e-10, exact));
  EXPECT_EQ(pair.coverage, 1);
}

TEST(Consistency, FlowFromFilesIsTheFlowThatWasWritten) {
  const testing::TemporaryFolder folder;
  std::vector<Image> waves;
  for (int i = 0; i < 3; ++i) waves.push_back(WaveImage(64, 48, 2 * i, i));
  for (const auto& [i, j] : {std::pair{0, 1}, {1, 0}, {1, 2}, {2, 1}})
    WriteFlowFile(folder / FlowFileName(i, j), ComputeFlow(waves[i], waves[j], "dis-medium"));
  ConsistencyOptions options = Gaps({1});
  const auto computed = EvaluateConsistency(Frames(waves), {{"s", Frames(waves)}}, options);
  options.flow = "files:" + folder.path();
  const auto read = EvaluateConsistency(Frames(waves), {{"s", Frames(waves)}}, options);
  EXPECT_EQ(*computed.rows.at(0).tc_psnr_mean_db, *read.rows.at(0).tc_psnr_mean_db);
  std::filesystem::remove(folder / FlowFileName(2, 1));
  EXPECT_REGRADE_ERROR(EvaluateConsistency(Frames(waves), {{"s", Frames(waves)}}, options),
                       ExitCode::kInput);
}

TEST(Consistency, StopsWhenAsked) {
  const FrameSource levels = Levels({0, 0.1f, 0.2f, 0.3f, 0.4f});
  const auto stop_at_two = [](const Progress& p) {
    return p.done >= 2 ? LoopControl::kStop : LoopControl::kContinue;
  };
  EXPECT_THROW(EvaluateConsistency(5, Still(), {{"s", levels}}, Gaps({1}), stop_at_two),
               Interrupted);
}

TEST(Consistency, EachFrameIsFetchedOnceForEachSequence) {
  std::vector<int> fetched(9, 0);
  const FrameSource frames{9, [&](int i) {
                             ++fetched[i];
                             return ConstantImage(kW, kH, 0.1f * static_cast<float>(i));
                           }};
  EvaluateConsistency(9, Still(), {{"s", frames}}, Gaps({1, 5}));
  for (const int count : fetched) EXPECT_EQ(count, 1);
}

// A mask that hides the pixels of the largest error raises the metric: by how much is a number
// of its own, over all pixels whose flow stays in the frame.
TEST(Consistency, WithAndWithoutTheMask) {
  Image first(4, 1, 3), second(4, 1, 3);
  for (int x = 0; x < 4; ++x)
    for (int c = 0; c < 3; ++c) second.at(x, 0)[c] = x == 3 ? 0.9f : x == 0 ? 0.3f : 0.1f;
  PairMotion motion{FlowField(4, 1), {}};
  motion.mask.weight = Image(4, 1, 1);
  for (const int x : {1, 2}) *motion.mask.weight.at(x, 0) = 1;
  motion.flow.at(3, 0)[0] = 9;  // leaves the frame
  const PairResult pair = ComparePair(first, second, motion);
  EXPECT_NEAR(*pair.psnr_db, 20, 1e-5);
  const double mean = (0.3 * 0.3 + 2 * 0.1 * 0.1) / 3;
  EXPECT_NEAR(*pair.unmasked_psnr_db, -10 * std::log10(mean), 1e-5);
  EXPECT_NEAR(pair.coverage, 0.5, 1e-12);
}

}  // namespace
}  // namespace regrade
