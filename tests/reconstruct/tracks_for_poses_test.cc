// Tracks for given poses, with a fake colmap that uses its database's image ids, and with
// failing ones.
#include "reconstruct/colmap/tracks_for_poses.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "kernels/base/error.h"
#include "tests/support/expect_error.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

class Tracks : public ::testing::Test {
 protected:
  Tracks() { fs::create_directories(folder_ / "photos"); }

  // Nine photos; the first one has no pose.
  std::vector<StagedPhoto> Photos() const {
    std::vector<StagedPhoto> photos;
    for (int i = 0; i < 9; ++i) {
      const std::string name = testing::StagedName(i);
      photos.push_back({name, name, folder_ / ("photos/" + name), 640, 480, 0});
    }
    return photos;
  }
  ColmapModel Posed() const {
    ColmapModel model = testing::MakeSyntheticModel();
    for (ColmapImage& image : model.images) {
      image.keypoints.clear();
      image.name = testing::StagedName(static_cast<int>(image.id));
    }
    model.points.clear();
    return model;
  }

  FoundTracks Find(const std::string& behaviour, const ColmapModel& posed,
                   const ProgressFunction& progress = {}) {
    const std::string link = folder_ / ("colmap-" + behaviour);
    if (!fs::exists(fs::symlink_status(link))) fs::create_symlink(FAKE_COLMAP, link);
    PoseOptions options{.colmap = link};
    return TracksForPoses(posed, Photos(), options, folder_ / "work", progress);
  }

  const testing::TemporaryFolder folder_;
};

TEST_F(Tracks, PointsHaveOurImageIdsAndPosesAreBitwiseEqual) {
  ColmapModel posed = Posed();
  // An image that has no photo.
  posed.images.push_back(posed.images[0]);
  posed.images.back().id = 40;
  posed.images.back().name = "elsewhere.png";
  const FoundTracks found = Find("good", posed);
  EXPECT_EQ(found.model.points.size(), 60u);
  EXPECT_EQ(found.observations, 480);
  EXPECT_EQ(found.pairs, 28);
  EXPECT_EQ(found.colmap_version, "3.8");
  // An observation with another image's id would have a large error.
  EXPECT_LT(found.median_px, 1e-9);
  ASSERT_EQ(found.model.images.size(), posed.images.size());
  for (size_t i = 0; i < posed.images.size(); ++i) {
    const RigidTransform &before = posed.images[i].camera_from_world,
                         &after = found.model.images[i].camera_from_world;
    EXPECT_EQ(found.model.images[i].id, posed.images[i].id);
    EXPECT_EQ(after.translation, before.translation);
    for (int r = 0; r < 3; ++r) EXPECT_EQ(after.rotation.row[r], before.rotation.row[r]);
  }
  const Capture capture = CaptureFromModel(found.model, Photos());
  EXPECT_EQ(capture.points.size(), 60u);
  EXPECT_LT(capture.reprojection_px, 1e-6);
}

TEST_F(Tracks, FilesOfAnEarlierRunAreReplaced) {
  fs::create_directories(folder_ / "work/triangulated");
  const FoundTracks first = Find("good", Posed()), again = Find("good", Posed());
  EXPECT_EQ(first.model.points.size(), again.model.points.size());
}

TEST_F(Tracks, FailuresAreErrorsOfTheProgram) {
  for (const char* behaviour : {"old", "half", "empty"}) {
    EXPECT_REGRADE_ERROR(Find(behaviour, Posed()), ExitCode::kExternalProgram, "");
  }
}

TEST_F(Tracks, NoCommonPointIsNotAnError) {
  EXPECT_TRUE(Find("sparse", Posed()).model.points.empty());
}

TEST_F(Tracks, AbortEndsTheChild) {
  int calls = 0;
  EXPECT_THROW(Find("hang", Posed(),
                    [&](const Progress& p) {
                      EXPECT_LE(p.done, p.total);
                      return ++calls > 4 ? LoopControl::kStop : LoopControl::kContinue;
                    }),
               Interrupted);
}

}  // namespace
}  // namespace regrade
