#include "stylize/training/restyle_field.h"

#include <utility>

#include "kernels/field/pad_sh_basis.h"
#include "stylize/field/blend_fields.h"
#include "stylize/training/style_engine.h"

namespace regrade {
namespace {

// Conclusion of the training and the network over the field, of the steps' time.
constexpr double kAfterTraining = 0.15;

}  // namespace

RestyledField Restyle(RadianceField field, const TrainingTargets& targets,
                      const RestyleRequest& request, const RestyleHooks& hooks) {
  RestyledField result;
  const SceneColorMap scene_map = targets.SceneMap(&result.notices);
  field.appearance = PadShBasis(std::move(field.appearance), kStyledBasis);
  // A ray's colour behind the box is a colour of the scene, too.
  const Vec3f source_background = field.background;
  if (request.options.map_background && request.object_weights == nullptr)
    field.background = MapBackground(scene_map.map, field.background);

  const std::unique_ptr<StyleEngine> engine =
      MakeStyleEngine(request.backend, &field, request.options);
  ProgressParts parts(hooks.training.progress, 1 + kAfterTraining);
  TrainingHooks training = hooks.training;
  training.progress = parts.Next(1);
  result.trained = TrainNetwork(field, targets.views(), scene_map, request.options, training,
                                request.resume, engine.get());
  Appearance restyled = engine->Restyle(result.trained.network, parts.Next(kAfterTraining));
  result.styled = {field.geometry, std::move(restyled), field.background, field.near_clip,
                   field.march};
  result.source = std::move(field);
  result.source.background = source_background;
  if (request.object_weights != nullptr)
    result.styled = MixFields(result.source, {&result.styled}, {1}, request.object_weights);
  if (hooks.check) {
    engine->weigher()->min_weight = 0;
    hooks.check(result, engine->weigher());
  }
  return result;
}

}  // namespace regrade
