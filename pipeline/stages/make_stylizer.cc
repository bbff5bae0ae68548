#include "pipeline/stages/make_stylizer.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/images/cube_file.h"
#include "pipeline/program/console.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/program/fetch_file.h"
#include "pipeline/report/stage_metrics.h"
#include "pipeline/stages/command_stylizer.h"
#include "pipeline/stages/folder_stylizer.h"
#include "pipeline/stages/matched_stylizer.h"
#include "pipeline/stages/network_probe.h"
#include "pipeline/stages/object_edit.h"
#include "pipeline/workspace/output_names.h"
#include "pipeline/workspace/stage_record.h"
#include "stylize/image/color_transfer.h"
#include "stylize/image/gaussian_mixture.h"
#include "stylize/image/map_stylizer.h"
#include "stylize/image/mixture_transfer.h"
#include "stylize/image/onnx_stylizer.h"
#include "stylize/image/sample_colors.h"

namespace regrade {
namespace {

// `photo` gives colours of all photos, so that a scene-wide map does not depend on which are
// held out; of a region, where its alpha says which pixels are of it.
std::unique_ptr<ViewStylizer> MakeColorMethod(StyleMethodKind kind, const StyleOptions& options,
                                              const Image& style, const Capture& capture,
                                              const PhotoFunction& photo) {
  // `all` colours evenly from all photos, but 256 of each at least.
  const auto sample = [&](int64_t all, std::vector<double>* heights = nullptr) {
    const int64_t most =
        std::max<int64_t>(256, all / std::max<int64_t>(1, std::ssize(capture.views)));
    std::vector<Vec3d> scene;
    for (size_t i = 0; i < capture.views.size(); ++i) {
      const std::optional<Image> picture = photo(i);
      if (!picture) continue;
      std::vector<double> of_view;
      for (const Vec3d& color :
           SampleColors(*picture, capture.views[i].path, most, heights ? &of_view : nullptr))
        scene.push_back(color);
      if (heights) heights->insert(heights->end(), of_view.begin(), of_view.end());
    }
    return scene;
  };
  if (kind == StyleMethodKind::kGmm) {
    std::vector<double> heights;
    const std::vector<Vec3d> scene = sample(kMixtureSample, &heights);
    return MakeMixtureTransfer(options, style, scene, heights);
  }
  if (!options.scene_wide) return MakeColorTransfer(options, style);
  std::vector<ColorStatistics> parts;
  for (size_t i = 0; i < capture.views.size(); ++i)
    if (const std::optional<Image> picture = photo(i))
      parts.push_back(MeasureForMethod(options, *picture));
  const ColorStatistics scene = Pool(parts);
  return MakeColorTransfer(options, style, &scene);
}

// How much of each pixel of the views is covered by splats, whose pictures take the photos'
// places.
class ShownParts {
 public:
  explicit ShownParts(const RunContext& context)
      : stored_(ReadFieldGeometry(context.workspace->Path("field.npz"))),
        views_(context.Views().InField(stored_)),
        renderer_(stored_.field, ChooseBackend(context.settings.run.device,
                                               context.settings.run.reproducible)) {}

  Image Of(int view) const {
    return CoverageOf(renderer_.Render(views_.CameraOf(view)).transmittance);
  }

 private:
  StoredField stored_;
  WorkingViews views_;
  FieldRenderer renderer_;
};

// The picture with what is of the region, if it shows any of it.
std::optional<Image> PartOf(const std::optional<Image>& picture, const Image& region) {
  if (!picture || !ShowsRegion(region)) return std::nullopt;
  return WithRegion(*picture, region);
}

// The method with the files that it reads: a network's name stands for its folder.
StyleMethod MethodWithFiles(const StyleOptions& options) {
  StyleMethod method = ParseStyleMethod(options);
  if (method.kind == StyleMethodKind::kNetwork)
    method = {StyleMethodKind::kOnnx, method.name, NetworkFolder(method.name)};
  return method;
}

std::unique_ptr<ViewStylizer> MakeMethod(RunContext* context, const Capture& capture,
                                         const std::string& path, const Image& style,
                                         const PhotoFunction& photo) {
  const RunSettings& settings = context->settings;
  const StyleMethod method = MethodWithFiles(settings.style_2d);
  if (IsCubeFile(path)) {
    const ColorLut lut = ReadCubeFile(path);
    return MakeMapStylizer(lut, kLutMethod, {SlopeText(lut)});
  }
  switch (method.kind) {
    case StyleMethodKind::kOnnx:
      return MakeOnnxStylizer(method.argument, settings.style_2d.max_side, style);
    case StyleMethodKind::kFolder:
      return MakeFolderStylizer(method.argument, FilesOf(capture));
    case StyleMethodKind::kCommand:
      return MakeCommandStylizer(method.argument, path, settings.style_2d.command_limit_s);
    default:
      return MakeColorMethod(method.kind, settings.style_2d, style, capture, photo);
  }
}

}  // namespace

std::unique_ptr<ViewStylizer> MakeSceneStylizer(RunContext* context, const WorkingViews& views,
                                                const ObjectMasks* masks,
                                                const CoverageFunction& coverage) {
  const RunSettings& settings = context->settings;
  const std::string path = settings.style.picture();
  const bool of_colors = MapsColors(ParseStyleMethod(settings.style_2d).kind);
  const Capture& capture = views.capture();
  const auto photo = [&](size_t i) -> std::optional<Image> {
    Image picture = views.PhotoToFit(static_cast<int>(i));
    if (picture.empty()) return std::nullopt;
    return picture;
  };
  if (settings.style.match.On())
    return MakeMatchedStylizer(
        settings.style, capture.views.size(), photo, of_colors,
        [&](const std::string& picture, const Image& style, const PhotoFunction& region) {
          return MakeMethod(context, capture, picture, style, region);
        });
  std::string notice;
  const Image style = StyleExample(path, &notice);
  if (!notice.empty()) context->console->Info(notice);
  std::vector<std::unique_ptr<ViewStylizer>> regions;
  if (masks == nullptr && capture.rendered) {
    const auto shown = std::make_shared<ShownParts>(*context);
    regions.push_back(MakeMethod(context, capture, path, style, [&](size_t i) {
      return PartOf(photo(i), shown->Of(static_cast<int>(i)));
    }));
    return MakeMaskedStylizer(
        std::move(regions), of_colors, coverage ? coverage : [shown](const Image&, int view) {
          return std::vector<Image>{shown->Of(view)};
        });
  }
  if (masks == nullptr) return MakeMethod(context, capture, path, style, photo);
  for (int k = 0; k < masks->num_regions(); ++k) {
    const Image part = masks->StyleRegion(k, style.width, style.height);
    const auto photo_region = [&](size_t i) -> std::optional<Image> {
      if (!masks->Knows(static_cast<int>(i))) return std::nullopt;
      const std::optional<Image> picture = photo(i);
      if (!picture) return std::nullopt;
      return PartOf(picture, masks->Coverage(static_cast<int>(i), picture->width,
                                             picture->height)[static_cast<size_t>(k)]);
    };
    regions.push_back(MakeMethod(context, capture, path,
                                 part.empty() ? style : WithRegion(style, part), photo_region));
  }
  return MakeMaskedStylizer(
      std::move(regions), of_colors, coverage ? coverage : [masks](const Image& view, int i) {
        return masks->Coverage(i, view.width, view.height);
      });
}

NetworkAccess AccessAfterYes(bool yes, Console* console) {
  NetworkAccess access;
  access.fetch = [](const std::string& address) { return FetchFile(address); };
  if (yes) {
    access.ask = [console](const std::string& offer) {
      console->Info(offer);
      return true;
    };
  } else if (CanAsk()) {
    access.ask = [](const std::string& offer) {
      return AnsweredYes(offer + ". Fetch it now?");
    };
  }
  return access;
}

void ProbeMethod(StyleOptions* options, const NetworkAccess& access) {
  namespace fs = std::filesystem;
  const StyleMethod method = ParseStyleMethod(*options);
  if (method.kind == StyleMethodKind::kNetwork) {
    const KnownNetwork& network = FindNetwork(method.name);
    if (access.fetch || HasNetwork(network)) ProbeStyleNetwork(EnsureNetwork(network, access));
    return;
  }
  if (method.kind == StyleMethodKind::kCommand) MakeCommandStylizer(method.argument, "", 0);
  if (!ReadsFiles(method.kind)) return;
  std::error_code error;
  if (!fs::exists(method.argument, error))
    throw InputError("there is no such file or folder", method.argument,
                     "what follows \"" + method.name + ":\" in --method must exist");
  const fs::path absolute = fs::absolute(method.argument, error);
  if (!error) options->method = method.name + ":" + absolute.lexically_normal().string();
  if (method.kind != StyleMethodKind::kOnnx) return;
  ProbeStyleNetwork(method.argument);
}

std::vector<int> StyledViews(const Workspace& workspace, const WorkingViews& working_views) {
  const auto with_picture = [&](const std::vector<int>& views) {
    std::vector<int> kept;
    for (const int i : views)
      if (std::filesystem::exists(workspace.Path("views_2d/" + FrameName(i))))
        kept.push_back(i);
    return kept;
  };
  std::vector<int> views = with_picture(working_views.Training());
  if (views.empty()) views = with_picture(working_views.HeldOut());
  if (views.empty())
    throw InputError("no view has a styled picture", workspace.Path("views_2d"),
                     "use --restart-from style_2d");
  return views;
}

JsonValue MethodFiles(const StyleOptions& options) {
  const StyleMethod method = MethodWithFiles(options);
  if (!ReadsFiles(method.kind)) return JsonValue();
  std::error_code error;
  return std::filesystem::is_regular_file(method.argument, error)
             ? JsonValue(HashFile(method.argument))
             : HashFolder(method.argument);
}

}  // namespace regrade
