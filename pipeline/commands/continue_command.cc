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
  if (PrintedHelp(command, arguments, context.options)) return;
  const Arguments words = context.options.Parse(arguments);
  CheckWords(command, words, 1, 1);
  const std::string& folder = words[0];
  if (!Workspace::Exists(folder))
    throw Error(ExitCode::kInput, "no run has worked in this folder", folder,
                "make one with `regrade run` or `regrade reconstruct`");
  const std::string run_json = folder + "/run.json";
  const RunFile file = ReadRunFile(run_json);
  context.options.ApplyConfig(file.options, run_json);
  if (const auto preset = context.options.Given("preset"))
    ApplyPreset(*preset, &context.settings);
  ApplyRecipeFlag(&context.options, &context.settings);
  context.options.ApplyFlags();
  RunSettings& settings = context.settings;
  ApplyProgramOptions(settings.program);
  if (!file.words.empty()) context.source = file.words[0];
  settings.run.out = std::filesystem::absolute(folder).lexically_normal().string();
  if (settings.style.picture.empty())
    throw Error(ExitCode::kUsage, "its value is missing", "--style",
                "name the picture whose colours the scene shall have");
  settings.style.picture =
      std::filesystem::absolute(settings.style.picture).lexically_normal().string();
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
