// Refinement of inaccurate poses by their tracks, and cases that must stay unchanged.
#include "reconstruct/refinement/refine_poses.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "kernels/base/random.h"
#include "reconstruct/refinement/bundle.h"
#include "tests/support/synthetic_model.h"

namespace regrade {
namespace {

using testing::MakeSyntheticModel;

double Normal(uint64_t stream, uint64_t counter) {
  return std::sqrt(-2 * std::log(1 - RandomDouble(11, stream, 2 * counter))) *
         std::cos(2 * M_PI * RandomDouble(11, stream, 2 * counter + 1));
}

// Sixteen photos of 400 points with noise of half a pixel in each coordinate. With `outliers`,
// one observation in twenty shows another point.
ColmapModel Tracks(bool outliers = false, ColmapLens lens = ColmapLens::kOpenCv) {
  ColmapModel model = MakeSyntheticModel(
      {.images = 16, .points = 400, .arc_deg = 90, .thickness = 2, .lens = lens});
  if (lens == ColmapLens::kOpenCvFisheye)
    model.cameras[0].intrinsics.lens = LensModel::kFisheye;
  uint64_t counter = 0;
  for (ColmapImage& image : model.images)
    for (ColmapKeypoint& keypoint : image.keypoints) {
      const ColmapPoint& point = *model.FindPoint(keypoint.point_id);
      model.CameraOf(image).Project(point.position, &keypoint.u, &keypoint.v);
      keypoint.u += 0.5 * Normal(0, counter);
      keypoint.v += 0.5 * Normal(1, counter);
      if (outliers && ++counter % 20 == 0) keypoint.u += 40 * Normal(2, counter);
      ++counter;
    }
  return model;
}

// Every camera rotated by `degrees` about a random axis and moved by `fraction` of the extent.
ColmapModel Perturbed(const ColmapModel& model, double degrees, double fraction) {
  ColmapModel perturbed = model;
  double extent = 0;
  for (const ColmapImage& a : model.images)
    for (const ColmapImage& b : model.images)
      extent = std::max(extent, Norm(a.camera_from_world.Inverse().translation -
                                     b.camera_from_world.Inverse().translation));
  for (ColmapImage& image : perturbed.images) {
    const auto direction = [&image](uint64_t stream) {
      return Eigen::Vector3d(Normal(stream, image.id), Normal(stream + 1, image.id),
                             Normal(stream + 2, image.id))
          .normalized();
    };
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(degrees * M_PI / 180, direction(3)).toRotationMatrix();
    const Eigen::Vector3d step = fraction * extent * direction(6);
    const Vec3d center =
        image.camera_from_world.Inverse().translation + Vec3d{step[0], step[1], step[2]};
    Mat3d rotation;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) rotation(i, j) = turn(i, j);
    rotation = rotation * image.camera_from_world.rotation;
    image.camera_from_world = {rotation, -(rotation * center)};
  }
  return perturbed;
}

struct Distance {
  double degrees = 0, fraction = 0;  // largest over the images
};

// After alignment by the best similarity: the mean rotation, then scale and translation of the
// centres.
Distance DistanceOf(const ColmapModel& model, const ColmapModel& truth) {
  const size_t n = model.images.size();
  const auto matrix = [](const Mat3d& m) {
    Eigen::Matrix3d result;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) result(i, j) = m(i, j);
    return result;
  };
  const auto center = [](const ColmapImage& image) {
    const Vec3d c = image.camera_from_world.Inverse().translation;
    return Eigen::Vector3d(c.x, c.y, c.z);
  };
  Eigen::Quaterniond mean_turn(0, 0, 0, 0);
  Eigen::Vector3d mean_mine(0, 0, 0), mean_theirs(0, 0, 0);
  for (size_t v = 0; v < n; ++v) {
    const Eigen::Quaterniond turn(
        Eigen::Matrix3d(matrix(truth.images[v].camera_from_world.rotation).transpose() *
                        matrix(model.images[v].camera_from_world.rotation)));
    mean_turn.coeffs() += turn.w() < 0 ? -turn.coeffs() : turn.coeffs();
    mean_mine += center(model.images[v]) / static_cast<double>(n);
    mean_theirs += center(truth.images[v]) / static_cast<double>(n);
  }
  const Eigen::Matrix3d turn = mean_turn.normalized().toRotationMatrix();
  double across = 0, along = 0, extent = 0;
  for (size_t v = 0; v < n; ++v) {
    const Eigen::Vector3d mine = turn * (center(model.images[v]) - mean_mine);
    across += mine.dot(center(truth.images[v]) - mean_theirs), along += mine.squaredNorm();
    for (size_t w = 0; w < v; ++w)
      extent = std::max(extent, (center(truth.images[v]) - center(truth.images[w])).norm());
  }
  Distance largest;
  for (size_t v = 0; v < n; ++v) {
    const Eigen::Matrix3d left = matrix(model.images[v].camera_from_world.rotation) *
                                 turn.transpose() *
                                 matrix(truth.images[v].camera_from_world.rotation).transpose();
    const Eigen::Vector3d moved =
        turn * (center(model.images[v]) - mean_mine) * (across / along) -
        (center(truth.images[v]) - mean_theirs);
    largest.degrees =
        std::max(largest.degrees, std::abs(Eigen::AngleAxisd(left).angle()) * 180 / M_PI);
    largest.fraction = std::max(largest.fraction, moved.norm() / extent);
  }
  return largest;
}

// 0.3 degrees are 3 px at a focal length of 600 px; noise of half a pixel in 400 observations
// leaves a tenth of that. The largest of sixteen errors must be within three reported standard
// errors, and these must be below the initial error.
TEST(RefinePoses, FindsThePosesOfTheTracks) {
  for (const bool outliers : {false, true}) {
    const ColmapModel truth = Tracks(outliers);
    const ColmapModel perturbed = Perturbed(truth, 0.3, 0.005);
    const Distance before = DistanceOf(perturbed, truth);
    const PoseRefinement refinement = RefinePoses(perturbed, {});
    ASSERT_TRUE(refinement.Accepted()) << refinement.refused;
    ASSERT_TRUE(refinement.turn_error_deg && refinement.moved_error);
    const Distance after = DistanceOf(refinement.model, truth);
    EXPECT_LT(after.degrees, 0.2 * before.degrees) << outliers;
    EXPECT_LT(after.fraction, 0.2 * before.fraction) << outliers;
    EXPECT_LT(after.degrees, 3 * *refinement.turn_error_deg) << outliers;
    EXPECT_LT(after.fraction, 3 * *refinement.moved_error) << outliers;
    EXPECT_LT(*refinement.turn_error_deg, 0.2 * before.degrees);
    EXPECT_GT(refinement.misfit_px, 2 * kPoseMisfit);
    // Noise of half a pixel in each coordinate has a median of 0.59 px; fitting reduces it
    // slightly for the adjusted observations and increases it for the held-out ones.
    EXPECT_NEAR(refinement.refined_px, 0.59, 0.06);
    EXPECT_NEAR(refinement.held_out_after_px, 0.59, 0.06);
    EXPECT_NEAR(refinement.turned_deg, 0.3, 0.06);
    EXPECT_NEAR(refinement.moved_fraction, 0.005, 0.001);
  }
}

TEST(RefinePoses, WorksThroughAFisheye) {
  const ColmapModel truth = Tracks(false, ColmapLens::kOpenCvFisheye);
  const ColmapModel perturbed = Perturbed(truth, 0.3, 0.005);
  const PoseRefinement refinement = RefinePoses(perturbed, {});
  ASSERT_TRUE(refinement.Accepted()) << refinement.refused;
  EXPECT_LT(DistanceOf(refinement.model, truth).degrees, 3 * *refinement.turn_error_deg);
  EXPECT_LT(*refinement.turn_error_deg, 0.06);
}

// On average the cameras neither rotate nor move.
TEST(RefinePoses, KeepsTheWorldFrame) {
  const ColmapModel perturbed = Perturbed(Tracks(), 0.3, 0.005);
  const PoseRefinement refinement = RefinePoses(perturbed, {});
  ASSERT_TRUE(refinement.Accepted());
  Vec3d moved;
  double scale_before = 0, scale_after = 0;
  for (size_t v = 0; v < perturbed.images.size(); ++v) {
    const Vec3d before = perturbed.images[v].camera_from_world.Inverse().translation;
    const Vec3d after = refinement.model.images[v].camera_from_world.Inverse().translation;
    moved += after - before;
    scale_before += Dot(before, before), scale_after += Dot(before, after);
  }
  EXPECT_LT(Norm(moved) / static_cast<double>(perturbed.images.size()), 1e-9);
  EXPECT_NEAR(scale_after / scale_before, 1, 0.01);
}

TEST(RefinePoses, AccuratePosesStayBitwiseUnchanged) {
  const ColmapModel truth = Tracks();
  const PoseRefinement refinement = RefinePoses(truth, {});
  EXPECT_FALSE(refinement.tried);
  EXPECT_LT(refinement.misfit_px, kPoseMisfit);
  for (size_t v = 0; v < truth.images.size(); ++v)
    EXPECT_EQ(refinement.model.images[v].camera_from_world.translation,
              truth.images[v].camera_from_world.translation);
}

// With wrong tracks no poses fit, and a refinement does not improve held-out observations.
TEST(RefinePoses, RejectsAResultThatDoesNotImproveHeldOutObservations) {
  ColmapModel model = Tracks();
  uint64_t counter = 0;
  for (ColmapImage& image : model.images)
    for (ColmapKeypoint& keypoint : image.keypoints) {
      keypoint.u += 20 * Normal(20, counter);
      keypoint.v += 20 * Normal(21, counter++);
    }
  const PoseRefinement refinement = RefinePoses(model, {});
  EXPECT_TRUE(refinement.tried);
  EXPECT_FALSE(refinement.Accepted());
  EXPECT_EQ(refinement.model.images[3].camera_from_world.translation,
            model.images[3].camera_from_world.translation);
}

TEST(RefinePoses, H154_OrderOfPhotosDoesNotMatter) {
  const ColmapModel perturbed = Perturbed(Tracks(), 0.3, 0.005);
  ColmapModel permuted = perturbed;  // the same photos with other ids
  const auto last = static_cast<uint32_t>(perturbed.images.size()) + 1;
  for (ColmapImage& image : permuted.images) image.id = last - image.id;
  std::reverse(permuted.images.begin(), permuted.images.end());
  for (ColmapPoint& point : permuted.points)
    for (ColmapTrackElement& element : point.track) element.image_id = last - element.image_id;
  const PoseRefinement a = RefinePoses(perturbed, {}), b = RefinePoses(permuted, {});
  ASSERT_TRUE(a.Accepted() && b.Accepted());
  EXPECT_EQ(a.held_out, b.held_out);
  // Sums have another order, so the minima agree to the solver's tolerance.
  const size_t n = perturbed.images.size();
  for (size_t v = 0; v < n; ++v)
    EXPECT_LT(Norm(a.model.images[v].camera_from_world.translation -
                   b.model.images[n - 1 - v].camera_from_world.translation),
              1e-4);
}

TEST(RefinePoses, AWrongFocalLengthIsCorrectedIfItIsFree) {
  ColmapModel model = Perturbed(Tracks(), 0.3, 0.005);
  model.cameras[0].intrinsics.fx *= 1.02;
  model.cameras[0].intrinsics.fy *= 1.02;
  const PoseRefinement fixed = RefinePoses(model, {});
  const PoseRefinement free = RefinePoses(model, {.free_focal = true});
  ASSERT_TRUE(free.Accepted()) << free.refused;
  EXPECT_EQ(fixed.model.cameras[0].intrinsics.fx, model.cameras[0].intrinsics.fx);
  EXPECT_NEAR(free.model.cameras[0].intrinsics.fx, 600, 4);  // it was 612
}

TEST(RefinePoses, H130_CamerasAtOnePlaceAreNotRefined) {
  ColmapModel model = Tracks();
  for (ColmapImage& image : model.images)
    image.camera_from_world.translation = image.camera_from_world.rotation * Vec3d{0, 0, 6};
  EXPECT_FALSE(RefinePoses(model, {}).Accepted());
  EXPECT_EQ(RefinePoses(model, {.asked_for = true}).refused, "all cameras are at one place");
}

TEST(RefinePoses, ModelsWithoutTracksAreNotRefined) {
  ColmapModel model = MakeSyntheticModel({.images = 4, .points = 0});
  EXPECT_FALSE(RefinePoses(model, {}).tried);
  EXPECT_FALSE(RefinePoses(model, {.asked_for = true}).Accepted());
}

}  // namespace
}  // namespace regrade
