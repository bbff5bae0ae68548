#include "pipeline/stages/style_residual.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/images/image_file.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/stages/carried_edit.h"
#include "pipeline/stages/make_stylizer.h"
#include "pipeline/stages/styled_field.h"
#include "pipeline/workspace/stage_record.h"
#include "stylize/field/voxel_residual.h"

namespace regrade {
namespace {

constexpr int64_t kMostResidualRays = 300000;  // of all views: 0.4 GB
// Seen from all sides a residual needs a lower cost than from one.
constexpr double kCostOfViews = 0.001;
constexpr int kScalings =
    3;  // fits with a layer, each with the scale of the last one, see EQ(view-scale)
constexpr int kTurnsAgain = 4;  // of these fits but the first: they begin where the last ended
// Below this, root mean square, a view lacks nothing that can be seen.
constexpr double kNoResidual = 0.5 / 255;

double RootMeanSquare(const Image& image) {
  double sum = 0, count = 0;
  for (const float v : image.pixels)
    if (std::isfinite(v)) sum += double{v} * double{v}, ++count;
  return std::sqrt(sum / std::max(1.0, count));
}

std::vector<Vec3f> Floats(const std::vector<Vec3d>& colors) {
  std::vector<Vec3f> floats;
  floats.reserve(colors.size());
  for (const Vec3d& x : colors) floats.push_back(x.Cast<float>());
  return floats;
}

class ResidualFit {
 public:
  ResidualFit(RunContext* context, const WorkingViews& views, const StoredField& source,
              const StoredNetwork& network)
      : context_(context),
        views_(views),
        source_(source),
        backend_(
            ChooseBackend(context->settings.run.device, context->settings.run.reproducible)),
        styled_(StyledFieldOf(source, network, 1, nullptr)),
        of_source_(source.field, backend_),
        stylizer_(MakeSceneStylizer(context, views)),
        graph_(GraphOf(source.field)) {
    if (!stylizer_->StylesAnything())
      throw InputError("has no pictures of renders", "the 2D method", "leave --residual out");
  }

  // What the styled field with `so_far` lacks, at the views, to method(render), with `edit(i)`
  // where there are edits. The fit begins at `start`, unless empty, which is part of `so_far`:
  // what the renderer shows of it counts, samples that it clamps at black among them.
  std::vector<Vec3d> Fit(const std::vector<int>& indices, const VoxelResidual& so_far,
                         const std::function<const RenderedEdit&(int)>& edit,
                         const ResidualOptions& options, std::vector<Vec3d> start,
                         const ProgressFunction& progress) const {
    RadianceField styled = styled_.field;
    if (!so_far.color.empty()) AddResidual(so_far, &styled.appearance);
    const FieldRenderer of_styled(std::move(styled), backend_);
    const int64_t most = kMostResidualRays / std::max<int64_t>(1, std::ssize(indices));
    ResidualRays rays;
    ProgressParts parts(progress, 2);
    const ProgressFunction rendering = parts.Next(1);
    for (size_t n = 0; n < indices.size(); ++n) {
      ReportOrThrow(rendering, static_cast<int64_t>(n), std::ssize(indices),
                    "residual by voxel");
      const int i = indices[n];
      const Camera camera = views_.CameraOf(i);
      const RenderedPair pair = of_source_.RenderWith(of_styled, camera);
      Image missing = Colors(stylizer_->Stylize(pair.view.color, i));
      if (edit) missing = edit(i).On(std::move(missing));
      for (size_t k = 0; k < missing.pixels.size(); ++k)
        missing.pixels[k] =
            std::clamp(missing.pixels[k], 0.0f, 1.0f) - pair.other_color.pixels[k];
      views_.LeaveOutMasked(i, &missing);
      if (start.empty() && RootMeanSquare(missing) < kNoResidual) continue;
      AddResidualRays(source_.field, camera, missing, most,
                      context_->settings.run.seed + static_cast<uint64_t>(i), &rays);
    }
    const ProgressFunction fitting = parts.Next(1);
    if (rays.num_rays() == 0) return std::vector<Vec3d>(static_cast<size_t>(graph_.voxels));
    if (!start.empty()) {
      const std::vector<Vec3d> seen = SumAlongRays(rays, start);
      for (size_t r = 0; r < seen.size(); ++r) rays.missing[r] += seen[r].Cast<float>();
    }
    const ResidualBounds bounds = BoundsWith(so_far, start);
    return FitResidual(graph_, rays, options, bounds, std::move(start), fitting);
  }

  // rho of colours that are added to the styled field.
  std::vector<Vec3f> ScaleOf(const std::vector<Vec3d>& color) const {
    return ViewScale(styled_.field.appearance, color);
  }

 private:
  // Where colours behind the network, with what `so_far` has beyond `start`, are black or
  // white.
  ResidualBounds BoundsWith(const VoxelResidual& so_far,
                            const std::vector<Vec3d>& start) const {
    Appearance appearance = styled_.field.appearance;
    VoxelResidual others{so_far.color, {}};
    for (size_t v = 0; v < start.size(); ++v) others.color[v] += start[v].Cast<float>() * -1.0f;
    if (!others.color.empty()) AddResidual(others, &appearance);
    return BoundsOfColors(appearance);
  }

  RunContext* context_;
  const WorkingViews& views_;
  const StoredField& source_;
  Backend backend_;
  StoredField styled_;
  FieldRenderer of_source_;
  std::unique_ptr<ViewStylizer> stylizer_;
  VoxelGraph graph_;
};

}  // namespace

VoxelResidual FitStyleResidual(RunContext* context, const WorkingViews& views,
                               const StoredField& source, const StoredNetwork& network,
                               const std::vector<int>& indices,
                               const ProgressFunction& progress) {
  const ResidualChoice& choice = context->settings.residual;
  ProgressParts parts(progress, 1 + kScalings);
  const ResidualFit fit(context, views, source, network);
  ResidualOptions options;
  options.cost = kCostOfViews;
  const std::vector<Vec3d> of_views = fit.Fit(indices, {}, nullptr, options, {}, parts.Next(1));
  VoxelResidual residual{Floats(of_views), {}};
  if (choice.Layers().empty()) return residual;

  const std::vector<RenderedEdit> edits = EditsOf(choice, views);
  std::vector<int> with_layer;
  for (int i = 0; i < views.count(); ++i)
    if (!edits[static_cast<size_t>(i)].empty()) with_layer.push_back(i);
  const auto edit_of = [&](int i) -> const RenderedEdit& {
    return edits[static_cast<size_t>(i)];
  };
  std::vector<Vec3d> all, edit;
  for (int turn = 0; turn < kScalings; ++turn) {
    options = ResidualOptions();
    if (turn > 0) options.turns = kTurnsAgain;
    edit = fit.Fit(with_layer, residual, edit_of, options, std::move(edit), parts.Next(1));
    all = edit;
    for (size_t v = 0; v < all.size(); ++v) all[v] += of_views[v];
    if (turn + 1 < kScalings) residual.view_scale = fit.ScaleOf(all);
    residual.color = Floats(all);
  }
  return residual;
}

void WriteLayer(const std::string& path, const Image& layer) {
  Image picture = layer;
  for (float& v : picture.pixels) v = std::clamp(0.5f + 0.5f * v, 0.0f, 1.0f);
  WritePng16(path, picture);
}

JsonValue ResidualInputs(const ResidualChoice& choice) {
  JsonValue inputs = JsonValue::Object{{"residual", choice.residual}};
  if (!choice.Layers().empty()) inputs["layers"] = HashFolder(choice.Layers());
  return inputs;
}

}  // namespace regrade
