#include "pipeline/stages/control_ceiling.h"

#include <utility>

#include "kernels/base/error.h"
#include "kernels/render/field_renderer.h"
#include "stylize/field/coefficient_fit.h"

namespace regrade {
namespace {

constexpr int kSteps = 30;
constexpr int64_t kMostRays = 600000;  // 0.6 GB with what they see

// What the field lacks to the pictures.
std::vector<Image> Missing(const RadianceField& field, const std::vector<Camera>& cameras,
                           const FrameSource& pictures) {
  const FieldRenderer renderer(field, Backend::kCpu);
  std::vector<Image> missing;
  for (size_t i = 0; i < cameras.size(); ++i) {
    Image lack = renderer.Render(cameras[i]).color;
    const Image picture = pictures.frame(static_cast<int>(i));
    REGRADE_CHECK(picture.SameSize(lack) && picture.channels >= 3);
    for (int64_t p = 0; p < lack.num_pixels(); ++p)
      for (int c = 0; c < 3; ++c) {
        float& value = lack.pixels[static_cast<size_t>(3 * p + c)];
        value = picture.pixels[static_cast<size_t>(p * picture.channels + c)] - value;
      }
    missing.push_back(std::move(lack));
  }
  return missing;
}

}  // namespace

StoredField CeilingField(StoredField styled, const std::vector<Camera>& cameras,
                         const FrameSource& pictures, uint64_t seed,
                         const ProgressFunction& progress) {
  const std::vector<Image> missing = Missing(styled.field, cameras, pictures);
  styled.field = FitCoefficients(std::move(styled.field), cameras, missing,
                                 {kSteps, kMostRays, seed}, progress);
  return styled;
}

}  // namespace regrade
