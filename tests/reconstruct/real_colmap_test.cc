// The installed COLMAP on a small real capture, from JPEG files to a Capture.
#include <gtest/gtest.h>

#include "pipeline/capture/ingest_photos.h"
#include "reconstruct/colmap/poses_from_photos.h"
#include "reconstruct/scene/scene_checks.h"
#include "tests/support/data.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

// COLMAP is not deterministic, so the bounds are wide.
TEST(RealColmap, Kermit) {
  REGRADE_NEED_DATA("kermit");
  if (!testing::HaveColmap()) GTEST_SKIP() << "no colmap here";
  const testing::TemporaryFolder folder;
  const IngestResult ingest =
      IngestPhotos(testing::DataPath("kermit"), folder / "photos", {}, {});
  PoseReport report;
  const Capture capture = PosesFromPhotos(ingest.photos, ingest.statuses, {}, folder / "work",
                                          folder / "sparse", {}, &report);
  EXPECT_GE(capture.views.size(), 10u);  // of 11
  EXPECT_GT(capture.points.size(), 200u);
  EXPECT_LT(capture.reprojection_px, 0.5);
  EXPECT_GT(MedianTriangulationAngle(capture), 0.2);
  // The EXIF focal length, about 660 px, is accurate to a few percent.
  EXPECT_NEAR(capture.views[0].camera.fx, 680, 70);
}

}  // namespace
}  // namespace regrade
