// regrade study: a page that asks which film people prefer, and what their answers show.
#include <algorithm>

#include "kernels/base/error.h"
#include "pipeline/commands/command.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/text.h"
#include "pipeline/study/make_study.h"
#include "pipeline/study/study_answers.h"

namespace regrade {
namespace {

struct StudyFileOptions {
  std::string out;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("out", out,
         {.help =
              "the page to write; of answers, where it may be left out, a JSON file of their "
              "analysis"});
  }
};

// The files that participants saved, instead of films?
bool AreAnswers(const Arguments& words) {
  return std::ranges::all_of(words,
                             [](const std::string& word) { return word.ends_with(".json"); });
}

}  // namespace

void RunStudy(const Command& command, const Arguments& arguments, Console* console) {
  constexpr size_t kMostParticipants = 10'000;
  StudyFileOptions file;
  StudyOptions study;
  ProgramOptions program;
  OptionSet options;
  options.Add("Study", &file);
  options.Add("Page", &study);
  options.Add("Program", &program);
  const auto prepared =
      Prepare(command, arguments, {.most_words = kMostParticipants}, &options);
  if (!prepared) return;
  if (AreAnswers(prepared->words)) {
    const JsonValue analysis = AnalyseStudy(ReadStudyAnswers(prepared->words));
    console->Event("study", analysis);
    console->Lines(FormatStudy(analysis));
    if (!file.out.empty()) WriteJsonFile(file.out, analysis);
    return;
  }
  CheckWords(command, prepared->words, 2, kMostMethods);
  RequireValue(file.out, "--out", "name the page to write");
  const MadeStudy made = MakeStudy(prepared->words, study);
  WriteFileAtomically(file.out, made.html);
  console->Info(Concat("wrote ", file.out, ": ", Counted(std::ssize(made.methods), "method"),
                       ", ", Counted(std::ssize(made.clips), "clip"), ", ",
                       Format("%.1f", static_cast<double>(made.html.size()) / 1e6), " MB"));
  console->Info(
      "The page does not show which film is whose, but its source has the methods' names; each "
      "participant sends back the file that it saves.");
}

}  // namespace regrade
