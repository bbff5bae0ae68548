// How a run went: what the film is compared with, and what the advice is about.
#include "pipeline/report/assessment.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/report/photo_spacing.h"

namespace regrade {
namespace {

ConsistencyMetrics Row(const std::string& sequence, double db) {
  ConsistencyMetrics row;
  row.sequence = sequence;
  row.tc_psnr_mean_db = db;
  return row;
}

RunReport SoftDraft(double train_db, double held_out_db) {
  RunReport report;
  report.preset = "draft";
  report.stages.reconstruct = ReconstructReport{.psnr_train_db = train_db,
                                                .detail_kept_train = 0.5,
                                                .psnr_heldout_db = held_out_db,
                                                .detail_kept_heldout = 0.4};
  report.spacing = PhotoSpacing{"00.png", "02.png", 0.9, {"01.png"}};
  return report;
}

// A camera at that angle on a circle around the origin, which it looks at.
CaptureView OnCircle(const std::string& file, double degrees) {
  const double a = degrees * M_PI / 180;
  CaptureView view;
  view.file = file;
  RigidTransform& camera = view.camera.camera_from_world;
  camera.rotation.row[0] = {-std::sin(a), 0, std::cos(a)};
  camera.rotation.row[1] = {0, -1, 0};
  camera.rotation.row[2] = {-std::cos(a), 0, -std::sin(a)};
  const Vec3d center{3 * std::cos(a), 0, 3 * std::sin(a)};
  camera.translation = -(camera.rotation * center);
  return view;
}

TEST(PhotoSpacing, TheGapOfACircleIsBetweenTheNeighboursOfALostPhoto) {
  Capture capture;
  for (const int i : {0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11})
    capture.views.push_back(OnCircle(std::to_string(i) + ".png", 30.0 * i));
  capture.statuses = {{"0.png"}, {"1.png", PhotoState::kUnregistered, "too few matches"}};
  const PhotoSpacing spacing = SpacingOf(capture);
  EXPECT_EQ(spacing.before, "0.png");
  EXPECT_EQ(spacing.after, "2.png");
  EXPECT_NEAR(spacing.widest, M_PI / 3, 1e-6);  // 60 degrees between their axes
  EXPECT_TRUE(spacing.far_apart());
  EXPECT_EQ(spacing.not_placed, std::vector<std::string>{"1.png"});
  capture.views.clear();
  for (int i = 0; i < 40; ++i) capture.views.push_back(OnCircle(std::to_string(i), 9.0 * i));
  EXPECT_FALSE(SpacingOf(capture).far_apart());
  EXPECT_EQ(SpacingOf({}).before, "");
}

TEST(Assessment, WherePhotosAreMissingTheAdviceNamesThePlace) {
  const RunReport sparse = SoftDraft(29, 18), dense = SoftDraft(29, 27.5);
  EXPECT_TRUE(LacksPhotos(*sparse.stages.reconstruct));
  EXPECT_FALSE(LacksPhotos(*dense.stages.reconstruct));
  const std::string advice = AssessmentOf(sparse).advice;
  for (const char* name : {"00.png", "01.png", "02.png"})
    EXPECT_NE(advice.find(name), std::string::npos) << advice;
  EXPECT_EQ(advice.find("--preset"), std::string::npos) << advice;
  EXPECT_NE(AssessmentOf(dense).advice.find("--preset standard"), std::string::npos);
}

TEST(Assessment, TheAdviceNamesTheNextPreset) {
  RunReport soft = SoftDraft(29, 27.5);
  const auto advice = [&](const std::string& preset) {
    soft.preset = preset;
    return AssessmentOf(soft).advice;
  };
  for (const auto& [preset, next] :
       {std::pair{"smoke", "draft"}, {"draft", "standard"}, {"standard", "best"}})
    EXPECT_NE(advice(preset).find(std::string("--preset ") + next), std::string::npos)
        << advice(preset);
  for (const char* finest : {"best", "paper"})
    EXPECT_EQ(advice(finest).find("--preset"), std::string::npos) << advice(finest);
  // Of a smoke run nothing else is to be mended.
  soft.stages.reconstruct.reset();
  EXPECT_NE(advice("smoke").find("--preset draft"), std::string::npos) << advice("smoke");
}

TEST(Assessment, SteadyIsTheFilms) {
  RunReport report;
  report.stages.render = RenderReport{.path_frames = 60, .film_frames = 120};
  report.evaluation.consistency = {Row("styled", 20), Row("views_2d", 25),
                                   Row("path_styled", 31), Row("path_views_2d", 30)};
  EXPECT_NE(AssessmentOf(report).sentences[1].find("1.0 dB steadier"), std::string::npos);
  // A film along the photos' places has no frames of its own.
  report.stages.render->path_frames = 0;
  EXPECT_NE(AssessmentOf(report).sentences[1].find("5.0 dB less steady"), std::string::npos);
  // Not measured: the frames at the photos' places do not stand for it.
  report.stages.render->path_frames = 60;
  report.evaluation.consistency.resize(2);
  EXPECT_EQ(AssessmentOf(report).sentences[1], "steady: not measured");
  // With --no-films nothing is said of a film.
  report.stages.render = RenderReport{};
  EXPECT_EQ(AssessmentOf(report).sentences[1],
            "steady: neighbouring views are 5.0 dB less steady than frame by frame");
}

}  // namespace
}  // namespace regrade
