// regrade evaluate: metrics of a run, or of frames or splats of any program.
#include <algorithm>

#include "kernels/base/error.h"
#include "pipeline/commands/continue_command.h"
#include "pipeline/commands/evaluate_frames.h"
#include "pipeline/commands/evaluate_splats.h"

namespace regrade {
namespace {

// "--frames A B C" as three flags, and "--splats" and "--name" in the same way.
Arguments SpreadLists(const Arguments& words) {
  Arguments spread;
  std::string list;  // the flag that further words belong to
  bool any = false;  // it has a value
  const auto end = [&] {
    if (!list.empty() && !any) spread.push_back(list);  // without a value, which Parse refuses
    list.clear();
  };
  for (size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    if (!list.empty() && !word.starts_with("--")) {
      spread.push_back(list + "=" + word);
      any = true;
      continue;
    }
    end();
    if (word == "--") {
      spread.insert(spread.end(), words.begin() + static_cast<std::ptrdiff_t>(i), words.end());
      return spread;
    }
    for (const std::string flag : {"--frames", "--splats", "--name"}) {
      if (word == flag || word.starts_with(flag + "=")) list = flag, any = word != flag;
    }
    if (list.empty() || any) spread.push_back(word);
  }
  end();
  return spread;
}

// Options of --frames and --splats that a run has not. Throws Error(kUsage).
void RefuseOptionsOfFrames(const Arguments& arguments, const OptionSet& options) {
  RunSettings settings;
  OptionSet of_run;
  settings.Bind(&of_run);
  const JsonValue known = of_run.Values(), all = options.Values();
  for (const auto& [name, value] : all.AsObject())
    for (const std::string& word : arguments)
      if (known.Find(name) == nullptr &&
          (word == "--" + name || word.starts_with("--" + name + "=")))
        throw UsageError("belongs to --frames and --splats", "--" + name, "leave it out");
}

}  // namespace

void RunEvaluate(const Command& command, const Arguments& words, Console* console) {
  const Arguments arguments = ExpandProtocol(words);
  FramesOptions frames;
  SplatsOptions splats;
  ConsistencyOptions consistency;
  ProgramOptions program;
  OptionSet options;
  options.Add("Of --frames and --splats", &frames);
  options.Add("Of --splats", &splats);
  options.Add("Evaluation", &consistency);
  options.Add("Program", &program);
  // Without these it evaluates the folder of a run, with all of a run's options.
  const bool has_frames = std::ranges::any_of(arguments, [](const std::string& word) {
    const std::string flag = word.substr(0, word.find('='));
    return flag == "--frames" || flag == "--splats" || flag == "--reference";
  });
  if (!has_frames && !AsksForHelp(arguments)) {
    RefuseOptionsOfFrames(arguments, options);
    return ContinueStyle(command, arguments, "evaluate", console);
  }
  if (!Prepare(command, SpreadLists(arguments), {.least_words = 0, .most_words = 0}, &options))
    return;
  if (!splats.splats.empty())
    return EvaluateSplats(splats, frames, consistency, options.Given("mode").has_value(), words,
                          console);
  if (frames.frames.empty())
    throw UsageError("there is nothing to compare with the reference", "--reference",
                     "add --frames DIR, or --splats FILE");
  for (const char* flag : {"up", "background", "size"})
    if (options.Given(flag))
      throw UsageError("belongs to --splats", std::string("--") + flag, "leave it out");
  frames.cameras = splats.views.cameras;
  EvaluateFrames(frames, consistency, words, console);
}

}  // namespace regrade
