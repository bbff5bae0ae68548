#include "pipeline/run_pipeline.h"

#include <algorithm>
#include <iterator>

#include "pipeline/stages/stages.h"

namespace regrade {
namespace {

struct Milestone {
  const char* name;
  Stage (*make)(RunContext*);
};

// photos --pose--> capture --reconstruct--> field
// capture + style --style_2d--> styled views;  field + styled views --stylize--> styled field
// both fields --render--> frames, films --evaluate--> figures --report--> report.json,
// report.html
constexpr Milestone kRoad[] = {
    {"pose", PoseStage},       {"reconstruct", ReconstructStage}, {"style_2d", Style2dStage},
    {"stylize", StylizeStage}, {"render", RenderStage},           {"evaluate", EvaluateStage},
    {"report", ReportStage},
};

const Milestone* Find(const std::string& name) {
  return std::find_if(std::begin(kRoad), std::end(kRoad),
                      [&name](const Milestone& m) { return name == m.name; });
}

}  // namespace

void RunPipeline(const std::string& first, const std::string& last, RunContext* context) {
  StageRunner runner(context->workspace, context->console);
  runner.SetDryRun(context->settings.start.dry_run);
  runner.RestartFrom(context->settings.start.restart_from);
  for (const Milestone* before = std::begin(kRoad); before != Find(first); ++before)
    runner.Require(before->name, "regrade run");
  for (const Milestone* milestone = Find(first); milestone != std::end(kRoad); ++milestone) {
    // In a dry run the stages behind an undone one have no inputs to look at yet.
    if (!runner.Run(milestone->make(context))) {
      if (last == milestone->name) return;
      for (++milestone; milestone != std::end(kRoad); ++milestone) {
        context->console->Info(std::string(milestone->name) + ": would be done after it");
        if (last == milestone->name) break;
      }
      return;
    }
    if (last == milestone->name) return;
  }
}

}  // namespace regrade
