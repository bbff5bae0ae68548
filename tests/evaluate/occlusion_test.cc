// Both masks against slow transcriptions of their published definitions, and their hard cases.
#include "evaluate/occlusion.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "evaluate/consistency.h"
#include "tests/evaluate/synthetic_frames.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

using namespace regrade::testing;

using Plane = std::vector<std::vector<double>>;  // [y][x]

Plane ChannelOf(const float* values, int width, int height, int channels, int channel) {
  Plane plane(height, std::vector<double>(width));
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      plane[y][x] = values[(static_cast<size_t>(y) * width + x) * channels + channel];
  return plane;
}

Plane Component(const FlowField& flow, int c) {
  return ChannelOf(flow.uv.data(), flow.width, flow.height, 2, c);
}

// Bilinear with each index clamped separately, weights from the unclamped position.
double Lookup(const Plane& plane, double x, double y) {
  const int h = static_cast<int>(plane.size()), w = static_cast<int>(plane[0].size());
  const double xf = std::floor(x), yf = std::floor(y), a = x - xf, b = y - yf;
  const auto cx = [&](double i) { return static_cast<int>(std::min(std::max(i, 0.), w - 1.)); };
  const auto cy = [&](double i) { return static_cast<int>(std::min(std::max(i, 0.), h - 1.)); };
  return (1 - a) * (1 - b) * plane[cy(yf)][cx(xf)] + a * (1 - b) * plane[cy(yf)][cx(xf + 1)] +
         (1 - a) * b * plane[cy(yf + 1)][cx(xf)] + a * b * plane[cy(yf + 1)][cx(xf + 1)];
}

Plane LiteralLai(const FlowField& forward, const FlowField& backward) {
  const int w = forward.width, h = forward.height;
  const Plane fu = Component(forward, 0), fv = Component(forward, 1);
  const Plane bu = Component(backward, 0), bv = Component(backward, 1);
  Plane mask(h, std::vector<double>(w, 1.0));
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      const double u = fu[y][x], v = fv[y][x];
      const double wu = Lookup(bu, x + u, y + v), wv = Lookup(bv, x + u, y + v);
      const double sum2 = (wu + u) * (wu + u) + (wv + v) * (wv + v);
      if (sum2 > 0.01 * (wu * wu + wv * wv + u * u + v * v) + 0.5) mask[y][x] = 0;
      double g = 0;
      for (const Plane* p : {&fu, &fv}) {
        if (x < w - 1) g += std::pow((*p)[y][x + 1] - (*p)[y][x], 2);
        if (y < h - 1) g += std::pow((*p)[y + 1][x] - (*p)[y][x], 2);
      }
      if (g > 0.01 * (u * u + v * v) + 0.002) mask[y][x] = 0;
    }
  return mask;
}

Plane LiteralRuder(const FlowField& forward, const FlowField& backward) {
  const int w = forward.width, h = forward.height;
  const Plane fu = Component(forward, 0), fv = Component(forward, 1);
  const Plane bu = Component(backward, 0), bv = Component(backward, 1);
  const auto mirrored = [](int i, int n) {
    return i < 0 ? -1 - i : i >= n ? 2 * n - 1 - i : i;
  };
  Plane value(h, std::vector<double>(w, 0.0)), outside = value;
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      const double u = fu[y][x], v = fv[y][x], bx = x + u, by = y + v;
      if (std::floor(bx) < 0 || std::floor(by) < 0 || std::floor(bx) + 1 >= w ||
          std::floor(by) + 1 >= h) {
        outside[y][x] = 1;
        continue;
      }
      const double wu = Lookup(bu, bx, by), wv = Lookup(bv, bx, by);
      const double cx = bx + wu, cy = by + wv;
      if ((cx - x) * (cx - x) + (cy - y) * (cy - y) >=
          0.01 * (u * u + v * v + wu * wu + wv * wv) + 0.5) {
        value[y][x] = -255;
        continue;
      }
      double g = 0;
      for (const Plane* p : {&fu, &fv}) {
        g += std::pow(.5 * (*p)[y][mirrored(x + 1, w)] - .5 * (*p)[y][mirrored(x - 1, w)], 2);
        g += std::pow(.5 * (*p)[mirrored(y + 1, h)][x] - .5 * (*p)[mirrored(y - 1, h)][x], 2);
      }
      value[y][x] = g > 0.01 * (u * u + v * v) + 0.002 ? 0 : 255;
    }
  Plane weight = value;
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      double sum = 0, norm = 0;
      for (int j = -2; j <= 2; ++j)
        for (int i = -2; i <= 2; ++i) {
          const double g = std::exp(-(i * i + j * j) / (2 * 0.8 * 0.8));
          sum += g * value[mirrored(y + j, h)][mirrored(x + i, w)];
          norm += g;
        }
      weight[y][x] = outside[y][x] ? 0 : std::min(std::max(sum / norm, 0.), 255.) / 255;
    }
  return weight;
}

// The pair error of Lai et al., whose program squares the masked difference.
double LiteralError(const Plane& mask, const Image& a, const Image& b, const FlowField& flow) {
  const Plane fu = Component(flow, 0), fv = Component(flow, 1);
  double numerator = 0, denominator = 0;
  for (int c = 0; c < 3; ++c) {
    const Plane pa = ChannelOf(a.pixels.data(), a.width, a.height, 3, c);
    const Plane pb = ChannelOf(b.pixels.data(), b.width, b.height, 3, c);
    for (int y = 0; y < a.height; ++y)
      for (int x = 0; x < a.width; ++x) {
        const double d = Lookup(pb, x + fu[y][x], y + fv[y][x]) - pa[y][x];
        numerator += mask[y][x] * mask[y][x] * d * d;
        denominator += mask[y][x];
      }
  }
  return numerator / denominator;
}

double FractionAt(const Image& weight, float value) {
  return static_cast<double>(std::count(weight.pixels.begin(), weight.pixels.end(), value)) /
         weight.num_pixels();
}

// The norm of LipRF's eq. 14 and the square of Lai et al.'s program hold the mask; the divisor
// is its sum.
TEST(Occlusion, ASoftMaskIsSquaredWithTheError) {
  PairMotion motion{FlowField(8, 6), {}};
  motion.mask.weight = ConstantImage(8, 6, 0.25f, 1);
  *motion.mask.weight.at(0, 0) = 1;
  const PairResult pair =
      ComparePair(ConstantImage(8, 6, 0.5f), ConstantImage(8, 6, 0.6f), motion);
  EXPECT_NEAR(*pair.error, 0.01 * (1 + 47 / 16.0) / (1 + 47 / 4.0), 1e-8);
}

TEST(Occlusion, Lai2018AgreesWithALiteralTranscription) {
  for (uint64_t seed = 0; seed < 4; ++seed) {
    const int w = 83 + static_cast<int>(seed), h = 71;
    const auto [forward, backward] = MixedFlows(w, h, seed);
    const OcclusionMask mask = MaskLai2018(forward, backward);
    const Plane expected = LiteralLai(forward, backward);
    for (int y = 0; y < h; ++y)
      for (int x = 0; x < w; ++x) ASSERT_EQ(*mask.weight.at(x, y), expected[y][x]);
    // Every branch is taken, so that the agreement is meaningful.
    EXPECT_GT(mask.Coverage(), 0.1);
    EXPECT_GT(mask.disoccluded, 50);
    EXPECT_GT(mask.motion_boundary, 50);
    EXPECT_GT(mask.out_of_frame, 50);

    const Image a = WaveImage(w, h, 0, 0), b = WaveImage(w, h, 3, 1);
    const PairResult pair = ComparePair(a, b, {forward, mask});
    EXPECT_NEAR(*pair.psnr_db, -10 * std::log10(LiteralError(expected, a, b, forward)), 1e-9);
  }
}

TEST(Occlusion, Ruder2016AgreesWithALiteralTranscription) {
  for (uint64_t seed = 0; seed < 4; ++seed) {
    const int w = 83 + static_cast<int>(seed), h = 71;
    const auto [forward, backward] = MixedFlows(w, h, seed);
    const OcclusionMask mask = MaskRuder2016(forward, backward);
    const Plane expected = LiteralRuder(forward, backward);
    for (int y = 0; y < h; ++y)
      for (int x = 0; x < w; ++x)
        ASSERT_NEAR(*mask.weight.at(x, y), expected[y][x],
                    testing::RecordBound(
                        "a weight against its definition", testing::Computed::kFloat,
                        *mask.weight.at(x, y) - expected[y][x], 1e-7));  // weights are float
    EXPECT_GT(FractionAt(mask.weight, 1), 0.01);  // noise leaves few pixels without a neighbour
    EXPECT_GT(1 - FractionAt(mask.weight, 1) - FractionAt(mask.weight, 0), 0.02);  // it is soft
    EXPECT_GT(mask.disoccluded, 50);
    EXPECT_GT(mask.motion_boundary, 20);

    const Image a = WaveImage(w, h, 0, 0), b = WaveImage(w, h, 3, 1);
    const PairResult pair = ComparePair(a, b, {forward, mask});
    EXPECT_NEAR(*pair.psnr_db, -10 * std::log10(LiteralError(expected, a, b, forward)), 1e-5);
  }
}

// A public evaluator scores the occluded pixels; here an error in them has no effect.
TEST(Occlusion, ErrorsAreTakenWhereTheMaskIsValid) {
  const auto [forward, backward] = MixedFlows(90, 70, 7);
  const OcclusionMask mask = MaskLai2018(forward, backward);
  const Image later = WaveImage(90, 70, 3, 1);
  Image a = WaveImage(90, 70, 0, 0), spoiled = a;
  for (int y = 0; y < 70; ++y)
    for (int x = 0; x < 90; ++x)
      if (*mask.weight.at(x, y) == 0) spoiled.at(x, y)[0] = 100;
  EXPECT_EQ(*ComparePair(a, later, {forward, mask}).error,
            *ComparePair(spoiled, later, {forward, mask}).error);
}

TEST(Occlusion, H116_UnknownFlowHasWeightZeroAndIsCounted) {
  for (const bool soft : {false, true}) {
    FlowField forward = ConstantFlow(40, 30, 1, 0), backward = ConstantFlow(40, 30, -1, 0);
    forward.at(10, 10)[0] = kNan;
    forward.at(20, 10)[1] = -std::numeric_limits<float>::infinity();
    backward.at(30, 20)[0] = kNan;  // sampled by (29, 20), whose target it is
    const auto mask = soft ? MaskRuder2016(forward, backward) : MaskLai2018(forward, backward);
    EXPECT_EQ(*mask.weight.at(10, 10), 0);
    EXPECT_EQ(*mask.weight.at(20, 10), 0);
    EXPECT_EQ(*mask.weight.at(29, 20), 0);
    EXPECT_EQ(mask.not_finite, 3);
    EXPECT_EQ(mask.disoccluded, 0);
    EXPECT_GT(*mask.weight.at(5, 20), 0.99f);
    EXPECT_TRUE(std::isfinite(mask.Coverage()));
  }
}

TEST(Occlusion, H116_TargetsOutOfTheFrameAreCountedApart) {
  const FlowField forward = ConstantFlow(40, 30, 8, 0), backward = ConstantFlow(40, 30, -8, 0);
  const OcclusionMask lai = MaskLai2018(forward, backward);
  EXPECT_EQ(lai.out_of_frame, 8 * 30);
  EXPECT_EQ(lai.disoccluded + lai.motion_boundary + lai.not_finite, 0);
  EXPECT_EQ(lai.Coverage(), 1) << "the original does not mask them";
  const OcclusionMask ruder = MaskRuder2016(forward, backward);
  // One row and column more: the taps there extend beyond the frame (H117).
  EXPECT_EQ(ruder.out_of_frame, 40 * 30 - 31 * 29);
  for (int y = 0; y < 30; ++y)
    for (int x = 0; x < 40; ++x)
      if (x >= 31 || y >= 29) {
        EXPECT_EQ(*ruder.weight.at(x, y), 0) << x << " " << y;
      }
  EXPECT_EQ(*ruder.weight.at(10, 10), 1);
}

TEST(Occlusion, H117_ATapOutsideTheFrameMakesNoContribution) {
  // Half a pixel beyond the last column: the position is in no four-pixel cell.
  const FlowField forward = ConstantFlow(30, 20, 0.5f, 0);
  const OcclusionMask mask = MaskRuder2016(forward, ConstantFlow(30, 20, -0.5f, 0));
  for (int y = 0; y < 20; ++y) EXPECT_EQ(*mask.weight.at(29, y), 0);
  EXPECT_EQ(*mask.weight.at(20, 10), 1);
}

TEST(Occlusion, H119_ThresholdGrowsWithMotionAndIsMonotone) {
  const auto trusted = [](float u, float mismatch, bool soft) {
    const FlowField f = ConstantFlow(300, 16, u, 0),
                    b = ConstantFlow(300, 16, -u + mismatch, 0);
    return *(soft ? MaskRuder2016(f, b) : MaskLai2018(f, b)).weight.at(20, 8) > 0;
  };
  for (const bool soft : {false, true}) {
    bool before = true;
    for (float mismatch = 0; mismatch < 12; mismatch += 0.25f) {
      const bool now = trusted(40, mismatch, soft);
      EXPECT_LE(now, before) << "more mismatch made a pixel trusted again";
      before = now;
    }
    EXPECT_FALSE(before);
    // By the formula: |m|^2 > 0.01 (u^2 + (u - m)^2) + 0.5.
    EXPECT_TRUE(trusted(0, 0.70f, soft));
    EXPECT_FALSE(trusted(0, 0.72f, soft));
    EXPECT_TRUE(trusted(100, 13.0f, soft));
    EXPECT_FALSE(trusted(100, 13.5f, soft));
  }
}

}  // namespace
}  // namespace regrade
