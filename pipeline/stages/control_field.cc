#include "pipeline/stages/control_field.h"

#include <cmath>
#include <filesystem>
#include <memory>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/fields/network_file.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/stages/fit_pictures.h"
#include "stylize/field/coefficient_fit.h"

namespace regrade {
namespace {

constexpr char kMark[] = "field_2d";  // names the checkpoint that says what was fitted

JsonValue InputsOfFit(const RunContext& context) {
  const RunSettings& settings = context.settings;
  return JsonValue::Object{{"field", context.ResultOf("reconstruct")},
                           {"views_2d", context.ResultOf("style_2d")},
                           {"fit", OptionsOfFit(settings)},
                           {"effects", settings.run.effects},
                           {"strength", settings.style.strength},
                           {"holdout", settings.run.holdout},
                           {"seed", settings.run.seed}};
}

}  // namespace

StoredField ControlField(RunContext* context, const WorkingViews& views,
                         const StoredField& scene, const std::vector<int>& indices,
                         const std::function<Image(int)>& picture,
                         const ProgressFunction& progress) {
  const RunSettings& settings = context->settings;
  Workspace& style = *context->style;
  const std::string path = style.Path(kFieldControlFile);
  const JsonValue inputs = InputsOfFit(*context);
  if (std::filesystem::exists(path) && style.LoadCheckpoint(kMark, inputs)) {
    Report(progress, 1, 1);
    return ReadFieldFile(path);
  }
  style.DropCheckpoint(kMark);  // the file is another one from here on
  const FittedPictures fitted =
      FitPictures(views, scene, indices, picture, settings,
                  ReadNetworkFile(style.Path("network.npz")).background,
                  ChooseBackend(settings.run.device, settings.run.reproducible), progress);
  context->console->Info(Format("a field fitted to the 2D method's pictures: %.2f dB on them",
                                fitted.psnr_train_db));
  WriteFieldFile(path, fitted.stored);
  style.SaveCheckpoint(kMark, inputs, {"fitted"});
  return ReadFieldFile(path);
}

NamedFrameSource ControlFieldFrames(const StoredField& stored,
                                    const std::vector<Camera>& cameras, const PhotoGains& gains,
                                    const std::string& name) {
  const auto renderer = std::make_shared<const FieldRenderer>(stored.field, Backend::kCpu);
  return {name, {static_cast<int>(cameras.size()), [renderer, cameras, gains](int i) {
                   Image frame = renderer->Render(cameras[static_cast<size_t>(i)]).color;
                   PutGain(gains.Of(i), &frame);
                   for (float& value : frame.pixels) value = std::round(255 * value) / 255;
                   return frame;
                 }}};
}

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
