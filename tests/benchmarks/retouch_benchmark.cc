// How far a lifted edit is from its exact truth: rows for the best linear map, the 2D method,
// the network alone, the style with its residual, and the ceiling of any static field.
//
//   retouch_benchmark OUT GRADE STYLE EDITED
//
// OUT is the folder of a run on `regrade synth`'s still life, STYLE the style that `regrade
// retouch` made of its view number EDITED, graded as `--grade GRADE` does; the style was
// rendered. The truth is the grade of the unedited renders. The ceiling is the least squares of
// all voxels' or splats' coefficients to all true views, by conjugate gradients.
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/field/pad_sh_basis.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/network_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/stages/styled_field.h"
#include "stylize/field/coefficient_fit.h"
#include "tests/support/edit_truth.h"

namespace regrade {
namespace {

// Pictures of a field from all cameras.
std::vector<Image> Renders(const RadianceField& field, const std::vector<Camera>& cameras) {
  std::vector<Image> pictures;
  const FieldRenderer renderer(field, Backend::kCpu);
  for (const Camera& camera : cameras) pictures.push_back(renderer.Render(camera).color);
  return pictures;
}

int Run(const std::string& out, const std::string& grade, const std::string& name, int edited) {
  const std::string style = out + "/styles/" + name;
  StoredField source = ReadFieldFile(out + "/field.npz");
  source.field.appearance = PadShBasis(std::move(source.field.appearance), 9);
  constexpr int kAnySize = 1 << 16;
  const WorkingViews views = ReadWorkingViews(out + "/poses", kAnySize, 0).InField(source);
  const std::vector<Camera> cameras = views.Cameras();
  const testing::EditTruth truth(grade, Renders(source.field, cameras), edited);
  std::vector<Image> missing = truth.graded();
  for (size_t i = 0; i < missing.size(); ++i)
    for (size_t k = 0; k < missing[i].pixels.size(); ++k)
      missing[i].pixels[k] -= truth.renders()[i].pixels[k];
  const StoredNetwork network = ReadNetworkFile(style + "/network.npz");
  std::vector<Image> of_method;
  for (size_t i = 0; i < cameras.size(); ++i)
    of_method.push_back(
        ReadImage(style + "/frames/views_2d/" + Format("%05d.png", static_cast<int>(i))));

  const double linear = truth.ErrorsOf(truth.ByLinearMap()).inside;
  const double ceiling =
      truth.ErrorsOf(Renders(FitCoefficients(source.field, cameras, missing, {}), cameras))
          .inside;
  const auto row = [&](const char* what, const std::vector<Image>& pictures) {
    const testing::EditErrors errors = truth.ErrorsOf(pictures);
    std::printf("| %s | %.2e | %.1f %% | %.2f |\n", what, errors.inside,
                100 * (linear - errors.inside) / (linear - ceiling), 255 * errors.outside);
  };
  std::printf("| %s | squared error inside | removed | change outside, of 255 |\n",
              grade.c_str());
  std::printf("|---|---|---|---|\n| best linear map | %.2e | 0 %% | |\n", linear);
  row("unedited", truth.renders());
  row("2D method on renders", of_method);
  row("network alone", Renders(StyledFieldOf(source, network, 1, nullptr).field, cameras));
  row("with residual", Renders(ReadStyledField(out, style, 1).field, cameras));
  std::printf("| ceiling | %.2e | 100 %% | |\n", ceiling);
  return 0;
}

}  // namespace
}  // namespace regrade

int main(int argc, char** argv) {
  if (argc != 5) {
    std::fprintf(stderr, "usage: retouch_benchmark OUT GRADE STYLE EDITED\n");
    return 2;
  }
  try {
    return regrade::Run(argv[1], argv[2], argv[3], std::atoi(argv[4]));
  } catch (const regrade::Error& error) {
    std::fprintf(stderr, "retouch_benchmark: %s\n", error.what());
    return 1;
  }
}
