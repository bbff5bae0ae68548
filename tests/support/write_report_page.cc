// Writes a report page with every section, and hostile text wherever a name can be:
// write_report_page FOLDER. For tests that open it in a browser.
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "pipeline/files/atomic_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/report/html.h"

namespace regrade {
namespace {

ReportPicture Picture(float red, int width = 320, int height = 240) {
  Image image(width, height, 3);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      image.at(x, y)[0] = red;
      image.at(x, y)[1] = static_cast<float>(x) / static_cast<float>(width);
      image.at(x, y)[2] = static_cast<float>(y) / static_cast<float>(height);
    }
  return {EncodeJpeg(image, 80), width, height};
}

RunReport EveryMetric(const std::string& evil) {
  RunReport report;
  report.version = "0.1.0";
  report.command = {"regrade", "run", evil, "--style", evil};
  report.photos = PhotosReport{4, 2, 2, {}};
  for (const PhotoState state :
       {PhotoState::kUsed, PhotoState::kSkipped, PhotoState::kUnregistered, PhotoState::kUsed})
    report.photos->statuses.push_back(
        {evil + ToString(state), state, state == PhotoState::kSkipped ? evil : ""});
  report.effects = {{"exposure", false, "it was not wanted", Metric(), 0.1},
                    {"ndc", true, evil, 12.5, 25}};
  report.stages.reconstruct = ReconstructReport{.time = {60, 100},
                                                .voxels = 1000,
                                                .psnr_train_db = 28.25,
                                                .ssim_train = 0.83,
                                                .detail_kept_train = 0.66,
                                                .detail_error_train = 4.1,
                                                .psnr_heldout_db = 27.5,
                                                .ssim_heldout = 0.8,
                                                .detail_kept_heldout = 0.62,
                                                .detail_error_heldout = 4.4,
                                                .sharpness = "slightly soft",
                                                .heldout = {evil}};
  report.stages.stylize =
      StylizeReport{.steps = 300, .k_est = 1.5, .bound = 1.9, .notices = {evil}};
  for (int i = 1; i <= 40; ++i) {
    report.stages.reconstruct->psnr_at_steps.emplace_back(20 * i, 28 - 12.0 / i);
    report.stages.stylize->bound_at_steps.emplace_back(10 * i, 1.9 + 2 * std::exp(-0.1 * i));
  }
  for (const char* sequence : {"source", "views_2d", "styled", "path_styled"}) {
    ConsistencyMetrics row;
    row.sequence = sequence;
    row.pairs = 20;
    row.tc_psnr_mean_db = 30;
    for (int i = 0; i < 20; ++i)
      row.tc_psnr_pairs_db.push_back(i == 7 ? Metric() : Metric(30 + std::sin(0.5 * i)));
    report.evaluation.consistency.push_back(row);
  }
  report.evaluation.fidelity = {{.sequence = "styled",
                                 .psnr_to_2d_db = 24.5,
                                 .hue_std = 0.19,
                                 .hue_std_2d = 0.2,
                                 .chroma = 12,
                                 .chroma_2d = 13,
                                 .sliced_wasserstein_to_style = 0.01}};
  for (int i = 0; i < 6; ++i)
    report.costs.push_back({"fit", i == 0 ? "" : "fit-steps", evil, "held-out PSNR", "dB", 3,
                            12.0 + i, 0.5, 20.0 + 3 * i, 1, 25 + std::sqrt(i), 0.1,
                            i == 5 ? Metric() : Metric(0.1), i != 3, i == 3 ? evil : "", 0.8,
                            0.6 + 0.01 * i});
  report.options = {{"style", evil}};
  report.versions = {{"COLMAP", evil}};
  return report;
}

ReportPictures EveryPicture(const std::string& evil) {
  ReportPictures pictures;
  pictures.title = evil;
  pictures.style = Picture(0.9f);
  for (int i = 0; i < 3; ++i)
    pictures.views.push_back(
        {evil, Picture(0.1f), Picture(0.2f), Picture(0.5f), Picture(0.8f)});
  pictures.heat_maps = {{evil, Picture(1)}};
  pictures.thumbnails = {Picture(0.3f, 60, 112), std::nullopt, Picture(0.4f, 112, 60)};
  for (int i = 0; i < 12; ++i)
    pictures.cameras.cameras.push_back({std::cos(0.5 * i), std::sin(0.5 * i),
                                        -std::cos(0.5 * i), -std::sin(0.5 * i), 0.5, i % 8 == 0,
                                        evil});
  pictures.run_json = "{\"style\": \"" + evil + "\"}";
  return pictures;
}

}  // namespace
}  // namespace regrade

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const std::string evil =
      "</script><script>document.title='run'</script><img src=http://nowhere.invalid/x "
      "onerror=document.title='run'>" +
      std::string(300, 'w') + "'\"&\xE2\x80\xAE\xFF.jpg";
  std::filesystem::create_directories(argv[1]);
  const std::string page = std::string(argv[1]) + "/report.html";
  regrade::WriteFileAtomically(
      page, regrade::ReportHtml(regrade::EveryMetric(evil), regrade::EveryPicture(evil)));
  std::printf("%s\n", page.c_str());
  return 0;
}
