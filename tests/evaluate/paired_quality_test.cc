// Metrics of pictures against their ground truth.
#include "evaluate/paired_quality.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "tests/evaluate/synthetic_frames.h"

namespace regrade {
namespace {

using namespace regrade::testing;

TEST(HistogramCorrelation, AgreesWithItsDefinition) {
  const Image a = WaveImage(70, 40, 0, 0);
  Image b = a;
  for (float& p : b.pixels) p = 0.8f * p + 0.03f;
  double expected = 0;
  for (int c = 0; c < 3; ++c) {
    std::vector<double> ha(256), hb(256);
    for (int64_t p = 0; p < a.num_pixels(); ++p) {
      ++ha[std::lround(255 * a.pixels[3 * p + c])];
      ++hb[std::lround(255 * b.pixels[3 * p + c])];
    }
    double sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;
    for (int i = 0; i < 256; ++i)
      sa += ha[i], sb += hb[i], saa += ha[i] * ha[i], sbb += hb[i] * hb[i],
          sab += ha[i] * hb[i];
    expected +=
        (256 * sab - sa * sb) / std::sqrt((256 * saa - sa * sa) * (256 * sbb - sb * sb)) / 3;
  }
  EXPECT_NEAR(*HistogramCorrelation(a, b), expected, 1e-12);  // integers but for the shares
  EXPECT_NEAR(*HistogramCorrelation(a, a), 1, 1e-12);
}

TEST(HistogramCorrelation, PlacesAndSizesDoNotCount) {
  const Image a = NoiseImage(30, 20, 1);
  Image twice(60, 20, 3);
  for (int y = 0; y < 20; ++y)
    for (int half = 0; half < 2; ++half)
      std::copy_n(a.at(0, 19 - y), 90, twice.at(30 * half, y));
  EXPECT_NEAR(*HistogramCorrelation(a, twice), 1, 1e-12);
  EXPECT_NEAR(*HistogramCorrelation(ConstantImage(8, 8, 0.2f), ConstantImage(8, 8, 0.7f)),
              -1.0 / 255, 1e-12);  // two single bins of 256
  EXPECT_FALSE(HistogramCorrelation(ConstantImage(8, 8, kNan), a));
}

TEST(PairedQuality, MeansLeaveOutWhatIsInfinite) {
  const Image truth = NoiseImage(20, 20, 2);
  Image other = truth;
  for (float& p : other.pixels) p = 0.9f * p;
  const auto distance = [](const Image& a, const Image& b) {
    return a.pixels == b.pixels ? 0.0 : 0.5;
  };
  PairedRow row{
      "result",
      {MeasurePair("1", truth, truth, distance), MeasurePair("2", other, truth, distance)}};
  EXPECT_TRUE(std::isinf(*row.pictures[0].psnr_db));
  EXPECT_EQ(*row.Mean(&PairedQuality::psnr_db), *row.pictures[1].psnr_db);
  EXPECT_EQ(*row.Mean(&PairedQuality::lpips), 0.25);
  EXPECT_NEAR(*row.pictures[0].ssim, 1, 1e-12);
  EXPECT_LT(*row.pictures[1].ssim, 1);
  const std::string table = FormatPairedTable({row}, "text");
  EXPECT_NE(table.find("LPIPS"), std::string::npos) << table;
  for (PairedQuality& picture : row.pictures) picture.lpips.reset();
  EXPECT_EQ(FormatPairedTable({row}, "text").find("LPIPS"), std::string::npos);
  EXPECT_EQ(FormatPairedTable({{"none", {}}}, "csv").find("nan"), std::string::npos);
}

}  // namespace
}  // namespace regrade
