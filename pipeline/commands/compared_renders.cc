#include "pipeline/commands/compared_renders.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/image/decibels.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/files/text.h"

namespace regrade {
namespace {

constexpr int kRenderedSize = 400;  // pixels

}  // namespace

std::vector<Camera> ViewsOf(const std::string& folder, const StoredField& stored, int most) {
  const WorkingViews views =
      ReadWorkingViews(folder + "/poses", kRenderedSize, 0).InField(stored);
  const int count = std::min(most, views.count());
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) cameras.push_back(views.CameraOf(views.count() * i / count));
  return cameras;
}

std::vector<Image> RendersOf(const RadianceField& field, const std::vector<Camera>& cameras) {
  const FieldRenderer renderer(field, Backend::kCpu);
  std::vector<Image> renders;
  for (const Camera& camera : cameras) renders.push_back(renderer.Render(camera).color);
  return renders;
}

double PsnrOf(const std::vector<Image>& a, const std::vector<Image>& b) {
  double sum = 0, count = 0;
  for (size_t i = 0; i < a.size(); ++i)
    for (size_t k = 0; k < a[i].pixels.size(); ++k, ++count)
      sum += std::pow(double{a[i].pixels[k]} - double{b[i].pixels[k]}, 2);
  return Decibels(sum / std::max(count, 1.0));
}

std::string LossText(const std::vector<Image>& own, const std::vector<Image>& after) {
  return Format("its renders are %.1f dB from the field's own, on ", PsnrOf(own, after)) +
         Counted(std::ssize(own), "view") + Format(" of %d pixels", kRenderedSize);
}

}  // namespace regrade
