#include "pipeline/commands/continue_command.h"

#include "kernels/base/error.h"
#include "pipeline/commands/probe_styles.h"
#include "pipeline/run_pipeline.h"

namespace regrade {
namespace {

// The stages from `first` on, of styles of the folder of a run.
void Continue(const std::string& folder, const Prepared& prepared,
              const std::vector<NamedStyle>& styles, const std::string& first,
              RunContext* context) {
  RunSettings& settings = context->settings;
  if (!prepared.run_words.empty()) context->source = prepared.run_words[0];
  settings.run.out = AbsolutePath(folder);
  CheckTogether(settings);
  // Other styles of the scene may be worked on beside this one, and of a style its parts.
  Workspace workspace(folder, Workspace::BesideOthers());
  context->workspace = &workspace;
  context->console->OpenLog(workspace.Path(".regrade/log.txt"));
  if (!context->parts.One())
    RunStyles(first, styles, context);
  else
    RunPart(styles[0].name, context);
}

}  // namespace

void ContinueStyle(const Command& command, const Arguments& arguments, const std::string& first,
                   Console* console) {
  RunContext context;
  context.console = console;
  if (first == "render") context.options.Add("Parts", &context.parts);
  context.settings.Bind(&context.options);
  const auto prepared =
      Prepare(command, arguments, {.continues_style = true}, &context.options);
  if (!prepared) return;
  const std::string& folder = prepared->words[0];
  RunSettings& settings = context.settings;
  if (settings.style.pictures.size() > 1 && !settings.style.match.On())
    throw UsageError("continues one style", std::string("regrade ") + command.name,
                     "name it with --name");
  if (context.parts.One()) {
    ParsePart(context.parts.part);
    RefuseRequirements(context.options);
    if (!settings.start.restart_from.empty())
      throw UsageError("goes without --part", "--restart-from",
                       "remove parts/ of the style's folder to render parts again");
  }
  ProbeStyles(&settings, console, /*measured=*/!context.parts.One());
  const std::string given = context.options.Given("name").value_or("");
  Continue(folder, *prepared, {{ChosenStyle(folder, given), settings.style.pictures}}, first,
           &context);
}

// A style that has the name is made again, with its own options; without pictures, of its own,
// or of the run's.
void RunStylize(const Command& command, const Arguments& arguments, Console* console) {
  constexpr size_t kMostStyles = 64;
  RunContext context;
  context.console = console;
  context.settings.Bind(&context.options);
  const auto prepared =
      Prepare(command, arguments,
              {.most_words = 1 + kMostStyles, .continues_run = true, .prefers_style = true},
              &context.options);
  if (!prepared) return;
  const std::string& folder = prepared->words[0];
  StyleSource& style = context.settings.style;
  style.name = context.options.Given("name").value_or("");
  // Further words are pictures, too: --style A.jpg B.jpg.
  if (!context.options.Given("style") && prepared->words.size() > 1) style.pictures.clear();
  style.pictures.insert(style.pictures.end(), prepared->words.begin() + 1,
                        prepared->words.end());
  // That of the run belongs to its pictures.
  const bool other = context.options.Given("style") || prepared->words.size() > 1;
  if (other && !context.options.Given("match")) style.match.match = MatchChoice().match;
  ProbeStyles(&context.settings, console);
  Continue(folder, *prepared, NameStyles(folder, style.pictures, style.name, style.match.On()),
           "style_2d", &context);
}

}  // namespace regrade
