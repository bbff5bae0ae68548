#include "reconstruct/colmap/refine_intrinsics.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <limits>
#include <optional>

#include "kernels/base/error.h"
#include "kernels/base/quantile.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr double kLeastGain = 0.03;  // of the mean squared error, for four more parameters
constexpr double kLeastCornerShift = 0.5;  // pixels
constexpr double kMostDistortion = 15;     // pixels at a corner; above, skips PINHOLE
constexpr double kMostCenterShift = 0.1;   // of the picture's side
constexpr double kMostAspect = 1.05;       // fx / fy
// Times the median error; about three standard deviations where errors are normal.
constexpr double kOutlierFactor = 2.5;
constexpr size_t kFewestImages = 5;  // of a camera, for a free principal point

std::string NameOf(const LensAttempt& attempt) {
  return std::string(ColmapLensName(attempt.lens)) +
         (attempt.free_center ? ", free principal point" : ", principal point in the centre") +
         (attempt.held ? ", focal length held" : "");
}

// False for a diverged adjustment, which COLMAP writes all the same.
bool IsPlausible(const ColmapModel& model) {
  for (const ColmapCamera& camera : model.cameras) {
    const Camera& c = camera.intrinsics;
    if (std::abs(c.cx / c.width - 0.5) > kMostCenterShift) return false;
    if (std::abs(c.cy / c.height - 0.5) > kMostCenterShift) return false;
    if (std::abs(std::log(c.fx / c.fy)) > std::log(kMostAspect)) return false;
  }
  return true;
}

double LargestCornerShift(const ColmapModel& model) {
  double largest = 0;
  for (const ColmapCamera& camera : model.cameras)
    largest = std::max(largest, camera.intrinsics.MaxCornerDistortion());
  return largest;
}

// A few photos cannot distinguish a shifted centre from a rotated camera.
bool EnoughImagesForACenter(const ColmapModel& model) {
  for (const ColmapCamera& camera : model.cameras) {
    size_t images = 0;
    for (const ColmapImage& image : model.images) images += image.camera_id == camera.id;
    if (images < kFewestImages) return false;
  }
  return true;
}

// In pixels; infinite behind the camera.
double ErrorOf(const Camera& camera, const ColmapKeypoint& keypoint, const ColmapPoint& point) {
  double u, v;
  if (!camera.Project(point.position, &u, &v)) return std::numeric_limits<double>::infinity();
  return std::hypot(u - keypoint.u, v - keypoint.v);
}

}  // namespace

double MeanSquaredReprojection(const ColmapModel& model) {
  double sum = 0;
  int64_t count = 0;
  for (const ColmapImage& image : model.images) {
    const Camera camera = model.CameraOf(image);
    for (const ColmapKeypoint& keypoint : image.keypoints) {
      if (keypoint.point_id == kNoColmapPoint) continue;
      const double error = ErrorOf(camera, keypoint, *model.FindPoint(keypoint.point_id));
      if (!std::isfinite(error)) continue;
      sum += error * error;
      ++count;
    }
  }
  return count > 0 ? sum / static_cast<double>(count) : 0;
}

ColmapModel WithoutOutliers(const ColmapModel& model, const ColmapModel& reference,
                            double factor) {
  REGRADE_CHECK_EQ(model.images.size(), reference.images.size());
  ColmapModel result = model;
  std::vector<std::vector<double>> errors(model.images.size());
  std::vector<double> all;
  for (size_t i = 0; i < model.images.size(); ++i) {
    const Camera camera = reference.CameraOf(reference.images[i]);
    for (const ColmapKeypoint& keypoint : model.images[i].keypoints) {
      // All observations of a point that the reference dropped are outliers.
      const ColmapPoint* point = reference.FindPoint(keypoint.point_id);
      errors[i].push_back(point ? ErrorOf(camera, keypoint, *point)
                                : std::numeric_limits<double>::infinity());
      if (point != nullptr) all.push_back(errors[i].back());
    }
  }
  if (all.empty()) return result;
  const double limit = factor * Median(std::move(all));

  std::erase_if(result.points, [&](ColmapPoint& point) {
    std::erase_if(point.track, [&](const ColmapTrackElement& element) {
      const size_t i =
          static_cast<size_t>(model.FindImage(element.image_id) - &model.images[0]);
      return errors[i][element.keypoint] > limit;
    });
    return point.track.size() < 2;
  });
  // Relinks the keypoints to the remaining tracks.
  for (ColmapImage& image : result.images)
    for (ColmapKeypoint& keypoint : image.keypoints) keypoint.point_id = kNoColmapPoint;
  for (const ColmapPoint& point : result.points)
    for (const ColmapTrackElement& element : point.track) {
      const size_t i =
          static_cast<size_t>(result.FindImage(element.image_id) - &result.images[0]);
      result.images[i].keypoints[element.keypoint].point_id = point.id;
    }
  return result;
}

ColmapModel WithLens(const ColmapModel& model, ColmapLens lens) {
  const ColmapLensInfo& info = InfoOf(lens);
  REGRADE_CHECK(info.focals > 0 &&
                (info.lens == LensModel::kPinhole || info.lens == LensModel::kOpenCv));
  ColmapModel result = model;
  for (ColmapCamera& camera : result.cameras) {
    Camera& c = camera.intrinsics;
    if (c.lens != LensModel::kOpenCv) c.distortion = {};
    std::fill(c.distortion.begin() + info.coefficients, c.distortion.end(), 0.0);
    if (info.focals == 1 && c.fx != c.fy) c.fx = c.fy = std::sqrt(c.fx * c.fy);
    camera.lens = lens;
    c.lens = info.lens;
  }
  return result;
}

RefinedModel RefineIntrinsics(ColmapProgram& colmap, const ColmapModel& mapped,
                              LensFreedom freedom, const std::string& work_folder,
                              const ColmapProgram::Limits& limits,
                              const std::function<void(int, int)>& on_step,
                              const KeepGoingFunction& keep_going) {
  int step = 0;
  const auto adjust = [&](const ColmapModel& start,
                          LensAttempt attempt) -> std::optional<RefinedModel> {
    const std::string number = std::to_string(step);
    const std::string before = work_folder + "/start_" + number;
    const std::string after = work_folder + "/adjusted_" + number;
    if (on_step) on_step(step, 5);
    ++step;
    for (const std::string& folder : {before, after}) {
      fs::remove_all(folder);
      fs::create_directories(folder);
    }
    WriteColmapModel(WithLens(start, attempt.lens), before);
    const ChildResult result = colmap.Run(
        "bundle_adjuster",
        {{"input_path", before},
         {"output_path", after},
         {"BundleAdjustment.refine_principal_point", attempt.free_center ? "1" : "0"},
         {"BundleAdjustment.refine_focal_length", attempt.held ? "0" : "1"},
         {"BundleAdjustment.refine_extra_params", attempt.held ? "0" : "1"},
         {"BundleAdjustment.function_tolerance", "1e-7"}},
        "bundle_adjuster_" + number, limits, {}, keep_going);
    RefinedModel refined{after, {}, attempt, NameOf(attempt)};
    try {
      refined.model = ReadColmapModel(after);
    } catch (const Error&) {
      // The reader rejects a diverged adjustment; a crash leaves nothing to read.
      return std::nullopt;
    }
    if (!result.Succeeded() || refined.model.images.size() != mapped.images.size() ||
        (attempt.free_center && !IsPlausible(refined.model)))
      return std::nullopt;
    refined.mean_squared_px = MeanSquaredReprojection(refined.model);
    return refined;
  };
  const auto choose_lens = [&](const ColmapModel& start, bool free_center) {
    std::optional<RefinedModel> opencv = adjust(start, {ColmapLens::kOpenCv, free_center});
    if (opencv && LargestCornerShift(opencv->model) > kMostDistortion) return opencv;
    std::optional<RefinedModel> pinhole = adjust(start, {ColmapLens::kPinhole, free_center});
    if (!pinhole || !opencv) return pinhole ? pinhole : opencv;
    const bool distorted =
        LargestCornerShift(opencv->model) > kLeastCornerShift &&
        opencv->mean_squared_px < (1 - kLeastGain) * pinhole->mean_squared_px;
    return distorted ? opencv : pinhole;
  };

  const ColmapModel start = WithoutOutliers(mapped, mapped, kOutlierFactor);
  std::optional<RefinedModel> chosen;
  if (freedom == LensFreedom::kSquarePixels) {
    chosen = adjust(start, {ColmapLens::kSimpleRadial});
  } else if (freedom == LensFreedom::kHeldFocal) {
    chosen = adjust(start, {ColmapLens::kSimplePinhole, false, true});
  } else {
    if (EnoughImagesForACenter(mapped)) chosen = choose_lens(start, true);
    if (!chosen) chosen = choose_lens(start, false);
  }
  if (chosen) {
    // Determines the outliers again: the mapper's fixed principal point misjudged some.
    const ColmapModel again = WithoutOutliers(mapped, chosen->model, kOutlierFactor);
    const std::optional<RefinedModel> better = adjust(again, chosen->attempt);
    return better ? *better : *chosen;
  }
  // No adjustment succeeded: returns the mapper's model.
  const std::string as_mapped = work_folder + "/as_mapped";
  fs::create_directories(as_mapped);
  WriteColmapModel(mapped, as_mapped);
  return {as_mapped, mapped, {}, "from the mapper", MeanSquaredReprojection(mapped)};
}

}  // namespace regrade
