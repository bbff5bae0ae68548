#include "pipeline/run_pipeline.h"

#include <algorithm>
#include <iterator>

#include "pipeline/stages/stages.h"

namespace regrade {
namespace {

struct StageEntry {
  const char* name;
  Stage (*make)(RunContext*);
};

// The stages of a run, in order; each reads the results of earlier ones from the output folder.
// The code of stage NAME begins in pipeline/stages/NAME_stage.cc.
// clang-format off
constexpr StageEntry kStages[] = {
    // photos -> poses/: cameras and points by COLMAP or as given (reconstruct/colmap)
    {"pose", PoseStage},
    // poses/ -> field.npz: density and colour fitted to the photos (reconstruct/fit), whose
    // exposure is undone where they are read (pipeline/capture/working_views.h); the loss is in
    // kernels/field/render_ray.h
    {"reconstruct", ReconstructStage},
    // photos + style picture -> views_2d/: each photo styled in 2D (stylize/image)
    {"style_2d", Style2dStage},
    // field.npz + views_2d/ -> styled.npz: the field's colours mapped by a network of bounded
    // Lipschitz constant (stylize/training); its loss is in
    // stylize/field/gradient_aggregation.h
    {"stylize", StylizeStage},
    // field.npz + styled.npz -> frames/ (a ray in kernels/field/render_ray.h, the opacity of
    // its samples in kernels/field/volume_rendering.h), films (pipeline/images/video_writer.h)
    {"render", RenderStage},
    // frames/ -> consistency and fidelity metrics, heatmaps/ (evaluate)
    {"evaluate", EvaluateStage},
    // all records -> report.json, report.html (pipeline/report)
    {"report", ReportStage},
};
// clang-format on

const StageEntry* Find(const std::string& name) {
  return std::find_if(std::begin(kStages), std::end(kStages),
                      [&name](const StageEntry& m) { return name == m.name; });
}

}  // namespace

void RunPipeline(const std::string& first, const std::string& last, RunContext* context) {
  StageRunner runner(context->workspace, context->console);
  runner.SetDryRun(context->settings.start.dry_run);
  runner.RestartFrom(context->settings.start.restart_from);
  for (const StageEntry* before = std::begin(kStages); before != Find(first); ++before)
    runner.Require(before->name, "regrade run");
  for (const StageEntry* entry = Find(first); entry != std::end(kStages); ++entry) {
    // In a dry run the stages after an undone one have no inputs yet.
    if (!runner.Run(entry->make(context))) {
      if (last == entry->name) return;
      for (++entry; entry != std::end(kStages); ++entry) {
        context->console->Info(std::string(entry->name) + ": would follow");
        if (last == entry->name) break;
      }
      return;
    }
    if (last == entry->name) return;
  }
}

}  // namespace regrade
