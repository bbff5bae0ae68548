#include "reconstruct/colmap/simpler_lens.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr double kUsualAngleDeg = 50;  // between a phone's main camera, 65, and a portrait lens

double LongerSide(const CameraGroup& group) { return std::max(group.width, group.height); }

}  // namespace

const char* NameOf(LensFreedom freedom) {
  constexpr const char* kNames[] = {"", "one focal length", "focal length held"};
  return kNames[static_cast<int>(freedom)];
}

double HeldFocal(const CameraGroup& group) {
  return group.focal_px > 0
             ? group.focal_px
             : LongerSide(group) / (2 * std::tan(kUsualAngleDeg / 2 * M_PI / 180));
}

std::string HeldFocalText(const std::vector<CameraGroup>& groups) {
  const auto known = std::count_if(groups.begin(), groups.end(),
                                   [](const CameraGroup& group) { return group.focal_px > 0; });
  const std::string usual =
      "that of a lens that sees 50 degrees along the picture's longer side";
  if (known == 0) return usual + ", because the photos have no EXIF focal length";
  if (known == static_cast<std::ptrdiff_t>(groups.size())) return "that of EXIF";
  return "that of EXIF, or where there is none " + usual;
}

ColmapModel StartOf(const std::vector<CameraGroup>& groups, const PoseStrategy& strategy,
                    LensFreedom freedom) {
  REGRADE_CHECK(freedom != LensFreedom::kFull);
  const bool held = freedom == LensFreedom::kHeldFocal;
  ColmapModel model;
  for (const CameraGroup& group : groups) {
    ColmapCamera camera{static_cast<uint32_t>(model.cameras.size() + 1),
                        held ? strategy.lens : ColmapLens::kSimpleRadial,
                        {}};
    Camera& c = camera.intrinsics;
    c.width = group.width, c.height = group.height;
    c.fx = c.fy = held || group.focal_px > 0 ? HeldFocal(group)
                                             : strategy.focal_factor * LongerSide(group);
    c.cx = c.width / 2.0, c.cy = c.height / 2.0;
    c.lens = InfoOf(camera.lens).lens;
    model.cameras.push_back(camera);
  }
  return model;
}

void MapFrom(const std::string& start, const std::string& output, LensFreedom freedom,
             ColmapArguments* arguments) {
  for (auto& [name, value] : *arguments)
    if (name == "output_path") value = output;
  arguments->push_back({"input_path", start});
  if (freedom != LensFreedom::kHeldFocal) return;
  arguments->push_back({"Mapper.ba_refine_focal_length", "0"});
  arguments->push_back({"Mapper.ba_refine_extra_params", "0"});
}

}  // namespace regrade
