// Poses from photos with a fake colmap that fails in its ways; how processes end is tested in
// child_process_test.cc.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "kernels/base/error.h"
#include "reconstruct/colmap/colmap_model.h"
#include "reconstruct/colmap/colmap_strategies.h"
#include "reconstruct/colmap/poses_from_photos.h"
#include "tests/support/expect_error.h"
#include "tests/support/synthetic_model.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::StagedName;

class Poses : public ::testing::Test {
 protected:
  Poses() : folder_(fs::temp_directory_path() / ("poses test " + std::to_string(getpid()))) {
    fs::create_directories(folder_ / "photos");
  }
  ~Poses() override { fs::remove_all(folder_); }

  std::vector<StagedPhoto> Photos(int count) const {
    std::vector<StagedPhoto> photos;
    for (int i = 0; i < count; ++i)
      photos.push_back({"IMG " + std::to_string(i) + ".jpg", StagedName(i),
                        folder_ / "photos" / StagedName(i), 640, 480, exif_focal_px_, 8,
                        film_from_ >= 0 && i >= film_from_ ? 0 : -1});
    if (meters_apart_ > 0)
      for (int i = 0; i < count; ++i)
        photos[static_cast<size_t>(i)].gps = GeoPosition{46 + i * meters_apart_ / 111195, 7, 0};
    return photos;
  }

  // Runs with the fake colmap, which gets its behaviour from its name.
  Capture Run(const std::string& behaviour, int photos = 10,
              const ProgressFunction& progress = {}) {
    const fs::path link = folder_ / ("colmap-" + behaviour);
    if (!fs::exists(fs::symlink_status(link))) fs::create_symlink(FAKE_COLMAP, link);
    options_.colmap = link;
    return PosesFromPhotos(Photos(photos), statuses_, options_, folder_ / "work",
                           folder_ / "sparse", progress, &report_);
  }

  // Expects an error with this code whose text contains all parts.
  void ExpectError(const std::string& behaviour, ExitCode code,
                   const std::vector<std::string>& parts, int photos = 10) {
    const Error error = testing::ErrorFrom([&] { Run(behaviour, photos); });
    EXPECT_EQ(static_cast<int>(error.code()), static_cast<int>(code)) << error.what();
    for (const std::string& part : parts)
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    EXPECT_FALSE(fs::exists(folder_ / "sparse")) << "a refused model was returned";
  }

  fs::path folder_;
  double exif_focal_px_ = 0;
  double meters_apart_ = 0;  // places of the photos, in a row
  int film_from_ = -1;       // photos from this one on are frames of a film
  PoseOptions options_;
  PoseReport report_;
  std::vector<PhotoStatus> statuses_;
};

TEST_F(Poses, GoodCaptureComesWithModelAndStatuses) {
  statuses_ = {{"IMG 0.jpg", PhotoState::kUsed, ""},
               {"notes.txt", PhotoState::kSkipped, "not a picture"}};
  const Capture capture = Run("good");
  EXPECT_EQ(capture.views.size(), 10u);
  EXPECT_EQ(capture.points.size(), 60u);
  EXPECT_EQ(capture.models_found, 1);
  EXPECT_LT(capture.reprojection_px, 1e-6);
  EXPECT_EQ(report_.colmap_version, "3.8");
  EXPECT_EQ(report_.strategy, "quick");
  EXPECT_EQ(report_.attempts.size(), 1u);
  ASSERT_EQ(capture.statuses.size(), 11u);
  EXPECT_EQ(capture.statuses[1].why, "not a picture");
  EXPECT_EQ(ReadColmapModel((folder_ / "sparse").string()).images.size(), 10u);
}

TEST_F(Poses, ACardIsUsedWhereColmapHasCuda) {
  EXPECT_EQ(Run("gpu").views.size(), 10u);
  EXPECT_TRUE(report_.notes.empty());
  options_.colmap_gpu = "off";
  EXPECT_ANY_THROW(Run("gpu"));  // the stand-in insists on its card
}

TEST_F(Poses, ACardThatFailsIsReplacedByTheProcessor) {
  EXPECT_EQ(Run("broken-gpu").views.size(), 10u);
  ASSERT_EQ(report_.notes.size(), 1u);  // one command tells
  EXPECT_NE(report_.notes[0].find("feature_extractor failed on the GPU"), std::string::npos)
      << report_.notes[0];
  options_.colmap_gpu = "on";
  fs::remove_all(folder_ / "sparse");
  ExpectError("broken-gpu", ExitCode::kExternalProgram, {"feature_extractor failed"});
  ExpectError("good", ExitCode::kExternalProgram, {"without CUDA", "colmap-gpu at auto"});
}

// Frames of a film are matched by the list, in batches, and have a camera of their own.
TEST_F(Poses, F90_FramesOfAFilmAreMatchedByAList) {
  film_from_ = 5;
  double last = 0;
  const Capture capture = Run("good", 60, [&](const Progress& p) {
    EXPECT_GE(p.done, last);
    last = p.done;
    return LoopControl::kContinue;
  });
  EXPECT_EQ(capture.views.size(), 60u);
  std::ifstream list(folder_ / "work/attempt_1/pairs.txt");
  std::string first, second;
  int pairs = 0;
  for (; list >> first >> second; ++pairs) EXPECT_LT(first, second);
  EXPECT_GT(pairs, 0);
  EXPECT_LE(pairs, 200);
  const std::vector<CameraGroup> groups = GroupByCamera(Photos(60));
  ASSERT_EQ(groups.size(), 2u);
  EXPECT_EQ(groups[0].names.size(), 5u);
  EXPECT_TRUE(groups[1].film);
  film_from_ = -1;
  Run("good", 60);
  EXPECT_TRUE(fs::exists(folder_ / "work/attempt_2"));
  EXPECT_FALSE(fs::exists(folder_ / "work/attempt_2/pairs.txt"));
}

TEST_F(Poses, ManyPhotosAreMatchedByLikenessToo) {
  EXPECT_EQ(Run("good", 160).views.size(), 160u);
  EXPECT_TRUE(fs::exists(folder_ / "work/logs/vocab_tree_matcher.log"));
  EXPECT_TRUE(fs::exists(folder_ / "work/logs/mapper.log"));
  EXPECT_TRUE(report_.notes.empty());
}

TEST_F(Poses, WithoutAVocabularyTheOrderOfNamesIsLeft) {
  EXPECT_EQ(Run("no-vocabulary", 160).views.size(), 160u);
  ASSERT_EQ(report_.notes.size(), 1u);
  EXPECT_NE(report_.notes[0].find("vocab_tree_builder"), std::string::npos);
}

TEST_F(Poses, ManyPhotosOfADroneAreMatchedByTheirPlaces) {
  meters_apart_ = 25;
  EXPECT_EQ(Run("good", 160).views.size(), 160u);
  EXPECT_TRUE(fs::exists(folder_ / "work/logs/matches_importer.log"));
  EXPECT_FALSE(fs::exists(folder_ / "work/logs/sequential_matcher.log"));
}

TEST_F(Poses, ProgressGrowsToItsTotal) {
  double last = 0, most = 0;
  Run("good", 10, [&](const Progress& p) {
    EXPECT_GE(p.done, last);
    EXPECT_LE(p.done, p.total);
    EXPECT_FALSE(p.note.empty());
    last = p.done;
    most = std::max(most, p.done / p.total);
    return LoopControl::kContinue;
  });
}

TEST_F(Poses, AbortEndsTheChild) {
  int calls = 0;
  EXPECT_THROW(Run("hang", 10,
                   [&](const Progress&) {
                     return ++calls > 2 ? LoopControl::kStop : LoopControl::kContinue;
                   }),
               Interrupted);
}

TEST_F(Poses, F46_MissingProgram) {
  options_.colmap = "no-such-colmap";
  EXPECT_REGRADE_ERROR(
      PosesFromPhotos(Photos(10), {}, options_, folder_ / "work", folder_ / "sparse"),
      ExitCode::kExternalProgram, "no-such-colmap: ", "apt install colmap", "{\"colmap\":");
}

TEST_F(Poses, F47_Versions) {
  ExpectError("old", ExitCode::kExternalProgram, {"COLMAP 2.0 is too old"});
  ExpectError("something-else", ExitCode::kExternalProgram, {"not COLMAP", "hello, world"});
  // A later version has new names for some options and refuses the old ones.
  EXPECT_EQ(Run("new").views.size(), 10u);
  EXPECT_EQ(report_.colmap_version, "9.9");
}

TEST_F(Poses, F49_CrashIsReportedWithTheLog) {
  ExpectError("crash", ExitCode::kExternalProgram, {"mapper", "signal 6", "mapper.log"});
  ASSERT_FALSE(report_.notes.empty());
  EXPECT_NE(report_.notes[0].find("restarted with one thread"), std::string::npos);
}

TEST_F(Poses, F49_KilledForMemoryIsTriedAgainWithOneThread) {
  EXPECT_EQ(Run("memory").views.size(), 10u);
}

TEST_F(Poses, F50_HangEndsAtTheLimits) {
  options_.quiet_limit_min = 0.5 / 60;
  ExpectError("hang", ExitCode::kExternalProgram, {"printed nothing", "pose-time-limit"});
}

TEST_F(Poses, F50_TimeLimit) {
  options_.time_limit_min = 2.0 / 60;
  ExpectError("hang", ExitCode::kExternalProgram, {"time limit", "pose-time-limit"});
}

TEST_F(Poses, F50_AModelWrittenBeforeTheLimitIsUsed) {
  options_.quiet_limit_min = 0.5 / 60;
  EXPECT_EQ(Run("late").views.size(), 10u);
}

TEST_F(Poses, F51_SuccessWithoutAModel) {
  ExpectError("nothing", ExitCode::kExternalProgram, {"wrote no model"});
  ExpectError("empty", ExitCode::kExternalProgram, {"wrote no database"});
}

TEST_F(Poses, F51_SuccessWithHalfAModel) {
  ExpectError("half", ExitCode::kExternalProgram, {"damaged model", "points3D.bin"});
}

TEST_F(Poses, F52_Flood) {
  EXPECT_EQ(Run("flood").views.size(), 10u);
  EXPECT_LT(fs::file_size(folder_ / "work/logs/feature_extractor.log"), 17u << 20);
}

TEST_F(Poses, F29_FullDiskIsSeenInTheLog) {
  ExpectError("diskfull", ExitCode::kResources, {"disk is full"});
}

TEST_F(Poses, H125_NoPhotosAndOnePhoto) {
  ExpectError("good", ExitCode::kInput, {"no photos"}, 0);
  ExpectError("good", ExitCode::kScene, {"one photo"}, 1);
}

TEST_F(Poses, H125_TooFewPhotos) {
  ExpectError("good", ExitCode::kScene, {"3 photos are too few", "5 at least"}, 3);
  ExpectError("turned", ExitCode::kScene, {"3 photos are too few", "sideways"}, 3);
  options_.min_photos = 3;
  EXPECT_EQ(Run("good", 3).views.size(), 3u);
}

TEST_F(Poses, H127_CameraOnlyTurned) {
  ExpectError("turned", ExitCode::kScene, {"nearly one place", "step sideways"});
  ExpectError("nomodel", ExitCode::kScene, {"only turned", "step sideways"});
  EXPECT_GT(report_.attempts.size(), 1u);
}

TEST_F(Poses, H127_NothingMatches) {
  ExpectError("nomatches", ExitCode::kScene, {"no two photos show the same"});
  ExpectError("plain", ExitCode::kScene, {"about 12 each", "sharp photos"});
  ExpectError("apart", ExitCode::kScene, {"only 3 pairs of the 10 photos", "two thirds"});
}

TEST_F(Poses, H128_PlanarSceneIsNoted) {
  Run("planar");
  ASSERT_EQ(report_.notes.size(), 1u);
  EXPECT_NE(report_.notes[0].find("plane"), std::string::npos);
}

TEST_F(Poses, H132_TheLargestModelIsUsedAndTheOthersAreReported) {
  const Capture capture = Run("two", 13);
  EXPECT_EQ(capture.views.size(), 9u);
  EXPECT_EQ(capture.models_found, 2);
  EXPECT_EQ(capture.views[0].name, "00004.png");
  EXPECT_EQ(capture.statuses[0].status, PhotoState::kUnregistered);
  EXPECT_NE(capture.statuses[0].why.find("another group of 4 photos"), std::string::npos);
  ASSERT_FALSE(report_.notes.empty());
  EXPECT_NE(report_.notes.back().find("2 groups"), std::string::npos);
}

TEST_F(Poses, H133_FewRegisteredAreRefusedByName) {
  options_.min_photos = 3;
  ExpectError("few", ExitCode::kScene, {"only 4 of 10 photos", "IMG 9.jpg: only 89 features"});
  options_.min_registered = 0.3;
  const Capture capture = Run("few");
  EXPECT_EQ(capture.views.size(), 4u);
  EXPECT_EQ(capture.statuses[9].status, PhotoState::kUnregistered);
}

TEST_F(Poses, H134_PixelsThatAreNotSquare) {
  ExpectError("aspect", ExitCode::kScene, {"not square", "1.300"});
}

TEST_F(Poses, H134_ADivergingPrincipalPointStaysInTheCentre) {
  const Capture capture = Run("runaway");
  EXPECT_EQ(capture.views[0].camera.cx, 320);
  EXPECT_NE(report_.lens.find("in the centre"), std::string::npos);
}

TEST_F(Poses, H170_PixelsThatAreNotSquareAreTriedAgainWithOneFocalLength) {
  const Capture capture = Run("skewed");  // by the adjustment; the mapper's lens is simple
  EXPECT_EQ(capture.views[0].camera.fx, capture.views[0].camera.fy);
  EXPECT_EQ(report_.strategy, "quick, one focal length");
  EXPECT_EQ(report_.lens, "SIMPLE_RADIAL, principal point in the centre");
  EXPECT_EQ(report_.attempts,
            (std::vector<std::string>{"quick: 10 of 10 photos",
                                      "quick, one focal length: 10 of 10 photos"}));
  ASSERT_EQ(report_.notes.size(), 1u);
  EXPECT_NE(report_.notes[0].find("fx / fy = 0.913"), std::string::npos);
  EXPECT_NE(report_.notes[0].find("trying again with one focal length"), std::string::npos);
}

TEST_F(Poses, H170_ASimplerLensIsMappedFromTheSameFeaturesAndMatches) {
  Run("skewed-map", 24);  // enough photos that the mapper has two focal lengths
  EXPECT_EQ(report_.strategy, "quick, one focal length");
  ASSERT_EQ(report_.attempts.size(), 2u);
  EXPECT_NE(report_.attempts[0].find("fx / fy = 1.300"), std::string::npos);
  EXPECT_TRUE(fs::exists(folder_ / "work/attempt_1/database.db"));
  EXPECT_FALSE(fs::exists(folder_ / "work/attempt_2")) << "features were extracted again";
}

TEST_F(Poses, H170_AFoldedDistortionIsTriedAgain) {
  EXPECT_EQ(Run("folded").views[0].camera.distortion[1], 0);
  EXPECT_EQ(report_.strategy, "quick, one focal length");
  EXPECT_NE(report_.notes[0].find("folds"), std::string::npos);
}

TEST_F(Poses, H171_TheFocalLengthIsHeldAtThatOfExif) {
  exif_focal_px_ = 700;
  const Camera camera = Run("focal").views[0].camera;
  EXPECT_EQ(camera.fx, 700);
  EXPECT_EQ(camera.fy, 700);
  EXPECT_EQ(camera.MaxCornerDistortion(), 0);
  EXPECT_EQ(report_.strategy, "quick, focal length held");
  EXPECT_EQ(report_.attempts.size(), 3u);
  EXPECT_NE(report_.notes.back().find("held at that of EXIF"), std::string::npos);
}

TEST_F(Poses, H171_WithoutExifTheFocalLengthIsThatOfAUsualLens) {
  const Camera camera = Run("focal").views[0].camera;
  // The longer side of 640 px under 50 degrees.
  EXPECT_NEAR(2 * std::atan(320 / camera.fx) * 180 / M_PI, 50, 1e-9);
  EXPECT_NE(report_.notes.back().find("50 degrees along the picture's longer side"),
            std::string::npos);
}

TEST_F(Poses, H172_ARefusalNamesEveryLensThatFailed) {
  ExpectError("no-lens", ExitCode::kScene,
              {"quick: pixels that are not square (fx / fy = 0.913)",
               "quick, one focal length: a focal length of 20.00 times",
               "quick, focal length held: no model", "keep their EXIF data"});
  EXPECT_EQ(report_.attempts.size(), 3u);
  EXPECT_EQ(report_.notes.size(), 2u);  // which the console shows: one for each further lens
}

TEST_F(Poses, StrategiesAreTriedUntilOneSucceeds) {
  EXPECT_EQ(Run("strategies").views.size(), 10u);
  EXPECT_EQ(report_.strategy, "more features");
  EXPECT_EQ(report_.attempts.size(), 2u);
}

TEST_F(Poses, AnAttemptThatWouldFindTheSameFeaturesIsSkipped) {
  EXPECT_THROW(Run("nomodel"), Error);
  EXPECT_EQ(report_.attempts.size(), 3u);  // all except "more features": there are no more
  EXPECT_THROW(Run("nomatches"), Error);
  EXPECT_EQ(report_.attempts.size(), 4u);  // one more: nothing helps without matches
}

}  // namespace
}  // namespace regrade
