#include "pipeline/commands/continue_command.h"

#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/images/image_file.h"
#include "pipeline/run/run_file.h"
#include "pipeline/run_pipeline.h"
#include "pipeline/stages/make_stylizer.h"

namespace regrade {

void ContinueRun(const Command& command, const Arguments& arguments, const std::string& first,
                 Console* console) {
  RunContext context;
  context.console = console;
  context.settings.Bind(&context.options);
  const auto prepared = Prepare(command, arguments, {.continues_run = true}, &context.options);
  if (!prepared) return;
  const std::string& folder = prepared->words[0];
  RunSettings& settings = context.settings;
  if (!prepared->run_words.empty()) context.source = prepared->run_words[0];
  settings.run.out = AbsolutePath(folder);
  RequireValue(settings.style.picture, "--style", "name the style picture");
  settings.style.picture = AbsolutePath(settings.style.picture);
  ReadStylePicture(settings.style.picture, nullptr);
  ProbeMethod(&settings.style_2d);
  ProbeMasks(&settings.object);
  CheckTogether(settings);

  Workspace workspace(folder, settings.start.break_lock);
  context.workspace = &workspace;
  console->OpenLog(workspace.Path(".regrade/log.txt"));
  RunPipeline(first, "report", &context);
  if (!settings.start.dry_run) WriteRunFile("run", context);
}

void RunFolder(const Command& command, const Arguments& arguments, Console* console) {
  const bool stylize = std::string(command.name) == "stylize";
  ContinueRun(command, arguments, stylize ? "style_2d" : "render", console);
}

}  // namespace regrade
