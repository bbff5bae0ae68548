#include "reconstruct/colmap/colmap_lens.h"

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr ColmapLensInfo kLenses[kNumColmapLenses] = {
    {"SIMPLE_PINHOLE", 1, LensModel::kPinhole, 0},
    {"PINHOLE", 2, LensModel::kPinhole, 0},
    {"SIMPLE_RADIAL", 1, LensModel::kOpenCv, 1},
    {"RADIAL", 1, LensModel::kOpenCv, 2},
    {"OPENCV", 2, LensModel::kOpenCv, 4},
    {"OPENCV_FISHEYE", 2, LensModel::kFisheye, 4},
    {"FULL_OPENCV", 2, LensModel::kFullOpenCv, 8},
    {"FOV", 0, LensModel::kPinhole, 0},
    {"SIMPLE_RADIAL_FISHEYE", 1, LensModel::kFisheye, 1},
    {"RADIAL_FISHEYE", 1, LensModel::kFisheye, 2},
    {"THIN_PRISM_FISHEYE", 0, LensModel::kPinhole, 0},
};

}  // namespace

const ColmapLensInfo& InfoOf(ColmapLens lens) {
  const int number = static_cast<int>(lens);
  REGRADE_CHECK(number >= 0 && number < kNumColmapLenses);
  return kLenses[number];
}

void RefuseNewerLens(const std::string& what, const std::string& where) {
  throw InputError(what + ": it is of a newer COLMAP and not supported", where,
                   "run colmap image_undistorter, or pose the photos with OPENCV_FISHEYE (for "
                   "fisheye lenses) or OPENCV");
}

ColmapLens ColmapLensOf(LensModel lens) {
  switch (lens) {
    case LensModel::kPinhole:
      return ColmapLens::kPinhole;
    case LensModel::kOpenCv:
      return ColmapLens::kOpenCv;
    case LensModel::kFullOpenCv:
      return ColmapLens::kFullOpenCv;
    case LensModel::kFisheye:
      return ColmapLens::kOpenCvFisheye;
  }
  return ColmapLens::kPinhole;
}

}  // namespace regrade
