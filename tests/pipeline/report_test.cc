// The report page: untrusted text stays text, nothing is fetched, and missing metrics have
// reasons.
#include <gtest/gtest.h>

#include <limits>
#include <regex>
#include <string>

#include "pipeline/report/html.h"
#include "pipeline/report/html_text.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::CountOf;

ReportPicture Picture() { return {"\xFF\xD8\xFF pixels", 64, 48}; }

RunReport SomeReport() {
  RunReport report;
  report.version = "0.1.0";
  report.command = {"regrade", "run", "my photos", "--style", "it's.png"};
  report.seconds = 95;
  report.photos = PhotosReport{
      3,
      2,
      2,
      {{"a.jpg", PhotoState::kUsed, ""}, {"b.jpg", PhotoState::kSkipped, "cut at 20 kB"}}};
  report.effects = {{"ndc", false, "corner rays spread too far", 0.41, 0.9}};
  report.stages.reconstruct = ReconstructReport{
      .time = {60, {}},
      .voxels = 1000,
      .psnr_train_db = 28.25,
      .psnr_heldout_db = Metric::Undefined("holdout is 0"),
      .ssim_heldout = Metric::Undefined("holdout is 0"),
  };
  report.evaluation.consistency = {{.sequence = "styled",
                                    .pairs = 3,
                                    .undefined_pairs = 1,
                                    .tc_psnr_mean_db = 29.79,
                                    .tc_psnr_of_mean_db = 29.5,
                                    .coverage = 0.8,
                                    .tc_psnr_pairs_db = {30.0, Metric(), 29.5}}};
  report.evaluation.fidelity = {{.sequence = "styled",
                                 .psnr_to_2d_db = 24.5,
                                 .hue_std = 0.19,
                                 .hue_std_2d = 0.2,
                                 .chroma = 12,
                                 .chroma_2d = 13,
                                 .sliced_wasserstein_to_style = 0.01}};
  report.costs = {{"fit", "fit-steps", "5", "PSNR", "dB", 1, 1, 2, 3, 4, 5, 6, 7, true, ""}};
  return report;
}

ReportPictures SomePictures() {
  ReportPictures pictures;
  pictures.title = "fox";
  pictures.views = {{"00000, a.jpg", Picture(), Picture(), Picture(), Picture()}};
  pictures.heat_maps = {{"styled, frames 3 and 8", Picture()}};
  pictures.films = {{"styled.mp4", "the styled scene", Picture()}};
  pictures.scene_page = "scene.html";
  pictures.thumbnails = {Picture(), std::nullopt};
  pictures.cameras.cameras = {{0, 0, 0, 1, 0.5, true, "a.jpg"},
                              {1, 0.2, 0, 1, 0.5, false, "b"}};
  return pictures;
}

TEST(HtmlText, EscapesWhatAPageCouldRun) {
  EXPECT_EQ(EscapeHtml("<a b='c' d=\"e\">&"), "&lt;a b=&#39;c&#39; d=&quot;e&quot;&gt;&amp;");
  EXPECT_EQ(EscapeHtml("фото 写真 é"), "фото 写真 é");
}

TEST(HtmlText, SpellsOutBytesThatHideOrReorder) {
  EXPECT_EQ(EscapeHtml("a\x1b[31m\x7f"), "a\\x1b[31m\\x7f");
  EXPECT_EQ(EscapeHtml("gpj.\xE2\x80\xAE"
                       "exe"),
            "gpj.\\u{202e}exe");
  EXPECT_EQ(EscapeHtml("\xC0\xBCscript"), "\\xc0\\xbcscript");  // overlong '<'
  EXPECT_EQ(EscapeHtml("\xED\xA0\x80"), "\\xed\\xa0\\x80");     // a surrogate
  EXPECT_EQ(EscapeHtml("cut \xE2\x80"), "cut \\xe2\\x80");      // ends too early
  EXPECT_EQ(EscapeHtml(std::string("\xC3<", 2)), "\\xc3&lt;");  // must not swallow the '<'
}

TEST(HtmlText, ShellCommandSurvivesHostileNames) {
  EXPECT_EQ(ShellCommand({"regrade", "run", "$(rm -rf ~)", "it's", "", "a-b_c/d.png"}),
            "regrade run '$(rm -rf ~)' 'it'\\''s' '' a-b_c/d.png");
}

TEST(HtmlText, Base64VectorsOfRfc4648) {
  EXPECT_EQ(Base64(""), "");
  EXPECT_EQ(Base64("f"), "Zg==");
  EXPECT_EQ(Base64("fo"), "Zm8=");
  EXPECT_EQ(Base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(Base64("\xFF\xFE\xFD"), "//79");
}

TEST(HtmlText, NumbersAndDurations) {
  EXPECT_EQ(FixedNumber(-0.001, 2), "0.00");
  EXPECT_EQ(FixedNumber(29.786, 2), "29.79");
  EXPECT_EQ(Duration(0.84), "0.8 s");
  EXPECT_EQ(Duration(59.7), "1 min 00 s");
  EXPECT_EQ(Duration(7500), "2 h 05 min");
  EXPECT_EQ(GroupedNumber(999), "999");
  EXPECT_EQ(GroupedNumber(-1234567), "-1,234,567");
}

TEST(ReportHtml, AScenesQualityIsShownWhereThereArePhotos) {
  RunReport report = SomeReport();
  EXPECT_NE(ReportHtml(report, SomePictures()).find("reconstruction quality"),
            std::string::npos);
  report.stages.reconstruct->psnr_train_db = Metric::Undefined("there are no photos");
  EXPECT_EQ(ReportHtml(report, SomePictures()).find("reconstruction quality"),
            std::string::npos);
}

TEST(ReportHtml, HostileNamesStayText) {
  const std::string evil = "\"><script>alert('x')</script><img src=x onerror=alert(1)>.jpg";
  RunReport report = SomeReport();
  ReportPictures pictures = SomePictures();
  const std::string harmless = ReportHtml(report, pictures);
  report.version = report.preset = report.device = evil;
  report.command = {evil};
  report.photos->statuses = {{evil, PhotoState::kUsed, ""}, {evil, PhotoState::kSkipped, evil}};
  report.effects[0].name = report.effects[0].evidence = evil;
  report.stages.reconstruct->psnr_heldout_db = Metric::Undefined(evil);
  report.stages.reconstruct->device = evil;
  report.stages.style_2d = Style2dReport{.method = evil, .notices = {evil}};
  report.stages.evaluate = EvaluateReport{.flow = evil, .mask = evil, .comparison_note = evil};
  report.evaluation.consistency[0].sequence = report.evaluation.fidelity[0].sequence = evil;
  report.costs = {{"fit", evil, evil, evil, evil, 1, 1, 2, 3, 4, 5, 6, 7, true, evil}};
  report.options = {{evil, evil}};
  report.versions = {{evil, evil}};
  pictures.title = pictures.views[0].name = pictures.run_json = evil;
  pictures.heat_maps[0].caption = pictures.cameras.cameras[0].file = evil;
  pictures.films[0].file = pictures.films[0].caption = evil;
  const std::string page = ReportHtml(report, pictures);
  // As many scripts and pictures as on the harmless page.
  EXPECT_EQ(CountOf(page, "<script"), CountOf(harmless, "<script"));
  EXPECT_EQ(CountOf(page, "<img"), CountOf(harmless, "<img"));
  EXPECT_EQ(CountOf(page, "alert('x')"), 0u);
  EXPECT_GE(CountOf(page, "&lt;script&gt;alert(&#39;x&#39;)"), 20u);
}

TEST(ReportHtml, FetchesNothing) {
  const std::string page = ReportHtml(SomeReport(), SomePictures());
  EXPECT_EQ(CountOf(page, "http://") + CountOf(page, "https://") + CountOf(page, "@import"),
            0u);
  EXPECT_EQ(CountOf(page, "<link"), 0u);
  const std::regex address("(src|href|poster)=\"([^\"]{0,24})");
  int addresses = 0;
  for (std::sregex_iterator it(page.begin(), page.end(), address), end; it != end;
       ++it, ++addresses) {
    const std::string where = (*it)[2];
    EXPECT_TRUE(where.rfind("data:image/", 0) == 0 || where == "styled.mp4" ||
                where == "scene.html")
        << where;
  }
  EXPECT_EQ(addresses,
            2 + 4 + 1 + 2 + 1 + 1);  // headline pair, one view, a heat map, a film with its
                                     // poster, a thumbnail, the scene's page
}

TEST(ReportHtml, UndefinedMetricsHaveAReason) {
  const std::string page = ReportHtml(SomeReport(), SomePictures());
  EXPECT_NE(page.find("title=\"holdout is 0\""), std::string::npos);
  EXPECT_EQ(page.find("nan"), std::string::npos);
}

TEST(ReportHtml, ConsistencyNeverStandsAlone) {
  RunReport report = SomeReport();
  report.evaluation.fidelity.clear();
  const std::string page = ReportHtml(report, SomePictures());
  EXPECT_NE(page.find("fidelity to the 2D method"), std::string::npos);
  EXPECT_NE(page.find("title=\"not measured\""), std::string::npos);
}

TEST(ReportHtml, AnUndefinedPairBreaksTheLine) {
  const std::string page = ReportHtml(SomeReport(), SomePictures());
  EXPECT_EQ(CountOf(page, "<polyline"), 2u);
}

TEST(ReportHtml, TheBoundIsDrawnOverTheSteps) {
  RunReport report = SomeReport();
  report.stages.stylize = StylizeReport{.steps = 300, .k_est = 1.5, .bound = 1.9};
  EXPECT_EQ(ReportHtml(report, {}).find("Lipschitz bound over steps"), std::string::npos);
  report.stages.stylize->bound_at_steps = {{0, 1.9}, {25, 4.0}, {300, 1.9}};
  const std::string html = ReportHtml(report, {});
  EXPECT_NE(html.find("Lipschitz bound over steps"), std::string::npos);
  EXPECT_NE(html.find("K_est"), std::string::npos);
  EXPECT_EQ(html.find("nan"), std::string::npos);
  report.stages.stylize->variance = VarianceMetrics{{40, 3, 1.2, 0.01}, {}, {}, 0.7};
  report.stages.stylize->variance_across_views =
      VarianceMetrics{{}, {}, {}, 0.6, {}, VarianceGroupMetrics{7, 2, 1.1, 0.03}};
  EXPECT_NE(ReportHtml(report, {}).find("3 of 40</b> pairs"), std::string::npos);
}

TEST(ReportHtml, TheFitIsDrawnOverTheSteps) {
  RunReport report = SomeReport();
  report.stages.reconstruct->psnr_at_steps = {{20, 15.5}, {40, 21.25}};
  const std::string html = ReportHtml(report, {});
  EXPECT_NE(html.find("aria-label=\"PSNR of the fit over steps\""), std::string::npos);
  EXPECT_NE(html.find("training rays, 40: 21.25"), std::string::npos);
  EXPECT_EQ(html.find("held-out photos, at the end"), std::string::npos);  // there are none
  report.stages.reconstruct->psnr_heldout_db = 20;
  EXPECT_NE(ReportHtml(report, {}).find("held-out photos, at the end"), std::string::npos);
}

TEST(ReportHtml, OneWordSaysHowSharpWithItsNumber) {
  RunReport report = SomeReport();
  report.stages.reconstruct->detail_kept_train = 0.93;
  report.stages.reconstruct->sharpness = "sharp";
  std::string html = ReportHtml(report, {});
  EXPECT_NE(html.find("detail kept of the training photos"), std::string::npos);
  EXPECT_NE(html.find("sharp <small>0.93 of 1</small>"), std::string::npos);
  report.stages.reconstruct->detail_kept_heldout = 0.62;
  report.stages.reconstruct->ssim_heldout = 0.8;
  report.stages.reconstruct->sharpness = "slightly soft";
  report.stages.evaluate = EvaluateReport{.flow = "dis-medium", .lpips_heldout = 0.21};
  html = ReportHtml(report, {});
  EXPECT_NE(html.find("slightly soft <small>0.62 of 1</small>"), std::string::npos);
  EXPECT_NE(html.find("SSIM 0.800"), std::string::npos);
  EXPECT_NE(html.find("LPIPS 0.210"), std::string::npos);
  const std::string flat = "the photos have no fine detail";
  report.stages.reconstruct->detail_kept_heldout = Metric::Undefined(flat);
  report.stages.reconstruct->detail_kept_train = Metric::Undefined(flat);
  report.stages.reconstruct->sharpness.clear();
  EXPECT_NE(ReportHtml(report, {}).find("title=\"" + flat + "\""), std::string::npos);
}

TEST(ReportHtml, CostsHaveTheirSsimAndDetailOnlyWhereMeasured) {
  RunReport report = SomeReport();
  EXPECT_EQ(ReportHtml(report, {}).find("<th class=n>SSIM"), std::string::npos);
  report.costs[0].ssim = 0.8125;
  report.costs[0].detail_kept = 0.5;
  const std::string html = ReportHtml(report, {});
  EXPECT_NE(html.find("<th class=n>SSIM<th class=n>detail kept<th>"), std::string::npos);
  EXPECT_NE(html.find("0.812"), std::string::npos);
}

TEST(ReportHtml, AnEffectThatWasNotMeasuredIsMarked) {
  RunReport report = SomeReport();
  report.effects = {{"exposure", false, "it was not wanted", Metric(), 0.1}};
  const std::string html = ReportHtml(report, {});
  EXPECT_NE(html.find("<td class=\"n soft\">not measured</td>"), std::string::npos);
}

TEST(ReportHtml, StagesHaveTheirCpuTime) {
  RunReport report = SomeReport();
  report.stages.reconstruct->time.cpu_seconds = 117;
  EXPECT_NE(ReportHtml(report, {}).find("1 min 57 s"), std::string::npos);
}

// A label of a member is all that the row of its stage needs.
TEST(ReportHtml, RowsOfStagesComeFromLabels) {
  RunReport report = SomeReport();
  report.stages.reconstruct->voxels = 2234881;
  report.stages.render = RenderReport{.frames = 48,
                                      .film = {640, 480},
                                      .frames_per_second = 0.9,
                                      .seen_by_few = {0.414, 0.72, 12, {}}};
  const std::string html = ReportHtml(report, {});
  for (const char* part :
       {"voxels <b>2,234,881</b>", "PSNR, training <b>28.25&nbsp;dB</b>", "frames <b>48</b>",
        "film <b>640 × 480&nbsp;px</b>", "speed <b>0.90&nbsp;frames/s</b>",
        "seen by fewer than three photos: 41 % of the film (72 % of frame 12)"})
    EXPECT_NE(html.find(part), std::string::npos) << part;
  EXPECT_EQ(html.find("finest"), std::string::npos);  // it has no label
}

TEST(ReportHtml, IsWholeWithoutJavaScript) {
  const std::string page = ReportHtml(SomeReport(), SomePictures());
  EXPECT_EQ(CountOf(page, "<script"),
            1u);  // the sliding edge between the headline pictures
  EXPECT_GE(CountOf(page, "<svg"), 2u);
}

TEST(ReportHtml, AnEmptyReportIsAPage) {
  const std::string page = ReportHtml(RunReport(), ReportPictures());
  EXPECT_EQ(page.find("<img"), std::string::npos);
  EXPECT_NE(page.find("</html>"), std::string::npos);
}

TEST(Metric, H111_NotFiniteIsUndefined) {
  EXPECT_FALSE(Metric(std::numeric_limits<double>::quiet_NaN()).value.has_value());
  EXPECT_FALSE(Metric(std::numeric_limits<double>::infinity()).value.has_value());
  EXPECT_TRUE(Metric(0.0).value.has_value());
}

}  // namespace
}  // namespace regrade
