// `regrade evaluate --pst50` on folders of that benchmark's layout.
#include "pipeline/commands/paired_benchmark.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "evaluate/pair_network.h"
#include "kernels/image/color_statistics.h"
#include "pipeline/images/image_file.h"
#include "stylize/image/monge_kantorovich.h"
#include "tests/evaluate/synthetic_frames.h"
#include "tests/support/data.h"
#include "tests/support/expect_error.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_onnx.h"

namespace regrade {
namespace {

using testing::TemporaryFolder;
using testing::WriteText;

// The ground truth that a linear map can reach.
Image Graded(const Image& content, const Image& style) {
  const ColorMap map = ComputeMkl(MeasureColor(content), MeasureColor(style)).map;
  Image graded = content;
  for (int64_t p = 0; p < graded.num_pixels(); ++p) {
    float* c = &graded.pixels[3 * p];
    const Vec3d value = map(Vec3d{c[0], c[1], c[2]});
    for (int k = 0; k < 3; ++k) c[k] = static_cast<float>(value[k]);
  }
  return graded;
}

// `content` and `style` as files of 8 bits have them.
void WritePair(const TemporaryFolder& folder, const std::string& name, Image content,
               Image style) {
  for (Image* image : {&content, &style})
    for (float& value : image->pixels) value = std::round(255 * value) / 255;
  const std::string truth = EncodePng8(Graded(content, style));
  WriteText(folder / ("pst50/content_709/" + name + ".png"), EncodePng8(content));
  WriteText(folder / ("pst50/paired_style/" + name + ".png"), EncodePng8(style));
  WriteText(folder / ("pst50/paired_gt/" + name + ".png"), truth);
  // The method copies its content, but for the first picture, where it is perfect.
  WriteText(folder / ("results/" + name + ".png"), name == "1" ? truth : EncodePng8(content));
}

void CheckRows(const std::vector<PairedRow>& rows, size_t pictures) {
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[0].name + rows[1].name + rows[2].name, "resultcontentcontrol_linear_map");
  for (const PairedRow& row : rows) ASSERT_EQ(row.pictures.size(), pictures);
  EXPECT_TRUE(std::isinf(*rows[0].pictures[0].psnr_db));
  EXPECT_NEAR(*rows[0].pictures[0].histogram_correlation, 1, 1e-12);
  for (size_t i = 1; i < pictures; ++i)
    EXPECT_EQ(*rows[0].pictures[i].psnr_db, *rows[1].pictures[i].psnr_db) << i;
  for (size_t i = 0; i < pictures; ++i) {
    // Rounding to 8 bits alone is 58.9 dB, and clipped values have no error.
    EXPECT_GT(*rows[2].pictures[i].psnr_db, 58) << i;
    EXPECT_LT(*rows[1].pictures[i].psnr_db, 40) << i;
    EXPECT_LT(*rows[1].pictures[i].histogram_correlation,
              *rows[2].pictures[i].histogram_correlation)
        << i;
  }
}

TEST(PairedBenchmark, RealPairsInItsLayout) {
  REGRADE_NEED_DATA("pst_pairs/in3.jpg");
  const TemporaryFolder folder;
  int number = 0;
  for (const char* pair : {"3", "11", "24", "34"}) {
    const std::string in = std::string("pst_pairs/in") + pair + ".jpg",
                      style = std::string("pst_pairs/tar") + pair + ".jpg";
    WritePair(folder, std::to_string(++number), ReadImage(testing::DataPath(in)),
              ReadImage(testing::DataPath(style)));
  }
  CheckRows(MeasurePairedFolder({folder / "pst50", folder / "results", true}, {}, {}), 4);
}

TEST(PairedBenchmark, FromTheCommandLine) {
  const TemporaryFolder folder;
  for (int i = 1; i <= 11; ++i)  // 9 before 10
    WritePair(folder, std::to_string(i), testing::WaveImage(64, 48, i, 0),
              testing::NoiseImage(40, 40, static_cast<uint64_t>(i)));
  const PairedFolder benchmark{folder / "pst50", folder / "results", true};
  const std::vector<PairedRow> rows = MeasurePairedFolder(benchmark, {}, {});
  CheckRows(rows, 11);
  EXPECT_EQ(rows[0].pictures[9].name, "10");
  WriteText(folder / "lpips.onnx", testing::DistanceNetwork(48, 64));
  const std::vector<std::string> words{
      "evaluate",         "--pst50", folder / "pst50",      "--frames",
      folder / "results", "--lpips", folder / "lpips.onnx", "--out",
      folder / "out"};
  const testing::ProgramOutcome done = testing::Regrade(words, {"--controls"});
  ASSERT_EQ(done.code, 0) << done.text;
  const JsonValue report = ReadJsonFile(folder / "out/report.json");
  const JsonValue& result = report.At("paired").AsArray()[0];
  EXPECT_EQ(result.At("number").AsInt(), 11);
  EXPECT_NEAR(result.At("psnr_db").AsDouble(), *rows[0].Mean(&PairedQuality::psnr_db), 1e-9);
  EXPECT_GT(result.At("lpips").AsDouble(), 1e-4);
  EXPECT_EQ(report.At("pictures").AsArray().size(), 33u);
  EXPECT_TRUE(report.At("pictures").AsArray()[0].At("psnr_db").IsNull());  // infinite
  EXPECT_SAYS(done, "control_linear_map");
  EXPECT_EQ(testing::Regrade(words, {"--reference", folder / "results"}).code, 2);

  std::filesystem::remove(folder / "results/7.png");
  EXPECT_REGRADE_ERROR(MeasurePairedFolder(benchmark, {}, {}), ExitCode::kInput,
                       "there is no picture 7");
  WriteText(folder / "results/7.png", EncodePng8(Image(32, 24, 3)));
  EXPECT_REGRADE_ERROR(MeasurePairedFolder(benchmark, {}, {}), ExitCode::kInput,
                       "picture 7 of result is 32 x 24 px");
  std::filesystem::remove_all(folder / "pst50/paired_gt");
  EXPECT_REGRADE_ERROR(MeasurePairedFolder(benchmark, {}, {}), ExitCode::kInput, "paired_gt");
}

}  // namespace
}  // namespace regrade
