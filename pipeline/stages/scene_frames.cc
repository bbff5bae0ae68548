#include "pipeline/stages/scene_frames.h"

#include <algorithm>
#include <utility>

#include "pipeline/capture/photo_gains.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/stages/styled_field.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {
namespace {

// The way of the film, if there is one.
FilmPath PathOf(const WorkingViews& views, const RenderOptions& options,
                const RadianceField* field) {
  if (options.films.films) return MakeFilmPath(views, options, field);
  FilmPath path;
  path.transmittance = path.photo_distance = Metric::Undefined("films were left out");
  return path;
}

const FrameSet* FirstOf(const std::vector<FrameSet>& sets, bool (*wanted)(const FrameSet&)) {
  const auto found = std::ranges::find_if(sets, wanted);
  return found == sets.end() ? nullptr : &*found;
}

}  // namespace

const FrameSet* FramePlan::film() const {
  return FirstOf(sets, [](const FrameSet& set) { return set.of_film; });
}

const FrameSet* FramePlan::common() const {
  return FirstOf(sets, [](const FrameSet& set) { return set.prefix == kCommonPrefix; });
}

int FramePlan::frames() const {
  int count = 0;
  for (const FrameSet& set : sets) count += static_cast<int>(set.cameras.size());
  return count;
}

int FramePlan::film_frames() const {
  return film() == nullptr ? 0 : static_cast<int>(film()->cameras.size());
}

FramePlan PlanFrames(const RunContext& context, const StoredField& before) {
  const RenderOptions& options = context.settings.render;
  WorkingViews views = context.Views().InField(before);
  FilmPath path = PathOf(views, options, &before.field);
  std::vector<FrameSet> sets = FrameSetsOf(views, options, path);
  // In NDC the field's limit is no distance.
  const double near = before.ndc.on() ? 0 : before.field.near_clip;
  return {std::move(views), std::move(path), std::move(sets), near};
}

std::vector<FrameSet> PlannedSets(const RunContext& context) {
  const WorkingViews views = context.Views();
  const RenderOptions& options = context.settings.render;
  return FrameSetsOf(views, options, PathOf(views, options, nullptr));
}

SceneFrames::SceneFrames(RunContext* context, const FramePlan& plan)
    : context_(context),
      plan_(plan),
      backend_(
          ChooseBackend(context->settings.run.device, context->settings.run.reproducible)) {
  masks_ = OpenObjectMasks(context->settings, plan.views);
  stylizer_ = MakeSceneStylizer(context, plan.views, masks_.get(),
                                [this](const Image&, int) { return coverage_; });
}

void SceneFrames::Show(StoredField before) {
  const RunSettings& settings = context_->settings;
  const Workspace& style = *context_->style;
  source_.reset(), styled_.reset(), object_.reset();  // first: fields have gigabytes
  if (masks_ != nullptr)
    object_ = std::make_unique<CoverageRenderer>(
        before.field, ReadObjectFile(style.Path("object.npz"), before.records));
  styled_.emplace(StyledFieldOf(before, style.folder(), settings.style.strength).field,
                  backend_);
  source_.emplace(std::move(before.field), backend_);
  if (!edit_) edit_.emplace(settings.residual, plan_.views, *source_);
}

std::vector<Camera> SceneFrames::CamerasOfEdits() const {
  if (edit_ || context_->settings.residual.Layers().empty()) return {};
  return plan_.views.Cameras();
}

// The scene as a camera of the photo's gain records it. Of the film, which is not measured on
// its own frames, there is no 2D method.
Frame SceneFrames::Render(const FrameSet& set, int index) {
  const Camera& camera = set.cameras[static_cast<size_t>(index)];
  const bool in_film_alone = set.prefix == kFilmPrefix;
  const double begin = context_->console->StageSeconds();
  RenderedPair pair = source_->RenderWith(*styled_, camera);
  seconds_ += context_->console->StageSeconds() - begin;
  Frame frame;
  frame.styled = std::move(pair.other_color);
  frame.source = std::move(pair.view.color);
  frame.transmittance = std::move(pair.view.transmittance);
  frame.depth = std::move(pair.view.depth);
  const PhotoGain gain = set.of_photos && context_->settings.render.keep_exposure
                             ? plan_.views.Gain(index)
                             : kAsTaken;
  PutGain(gain, &frame.source);
  PutGain(gain, &frame.styled);
  if (!in_film_alone) AddViews2d(camera, index, &frame);
  return frame;
}

void SceneFrames::AddViews2d(const Camera& camera, int index, Frame* frame) {
  if (object_ != nullptr)
    coverage_ = object_->Render(camera);
  else
    coverage_ = {CoverageOf(frame->transmittance)};
  if (!stylizer_->StylesAnything()) return;
  frame->views_2d = stylizer_->Stylize(frame->source, index);
  if (!edit_->empty()) frame->edited = edit_->AddTo(camera, frame->depth, &*frame->views_2d);
  MixPicture(frame->source, context_->settings.style.strength, &*frame->views_2d);
  // Nobody said what is wanted where the photo does not look: no difference is shown there.
  for (int64_t p = 0; p < frame->edited.num_pixels(); ++p)
    if (frame->edited.pixels[static_cast<size_t>(p)] == 0)
      std::copy_n(&frame->styled.pixels[static_cast<size_t>(3 * p)], 3,
                  &frame->views_2d->pixels[static_cast<size_t>(3 * p)]);
}

std::string SceneFrames::device() const { return DeviceName(backend_); }

}  // namespace regrade
