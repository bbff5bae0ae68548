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

// photos --pose--> capture --reconstruct--> field
// capture + style --style_2d--> styled views;  field + styled views --stylize--> styled field
// both fields --render--> frames, films --evaluate--> figures --report--> report.json,
// report.html
constexpr StageEntry kStages[] = {
    {"pose", PoseStage},       {"reconstruct", ReconstructStage}, {"style_2d", Style2dStage},
    {"stylize", StylizeStage}, {"render", RenderStage},           {"evaluate", EvaluateStage},
    {"report", ReportStage},
};

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
    // In a dry run the stages behind an undone one have no inputs to look at yet.
    if (!runner.Run(entry->make(context))) {
      if (last == entry->name) return;
      for (++entry; entry != std::end(kStages); ++entry) {
        context->console->Info(std::string(entry->name) + ": would be done after it");
        if (last == entry->name) break;
      }
      return;
    }
    if (last == entry->name) return;
  }
}

}  // namespace regrade
