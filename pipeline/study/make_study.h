// Writes a study of preference as one page: blind, in random order, with attention checks.
#pragma once

#include <string>
#include <vector>

namespace regrade {

inline constexpr char kStudyProtocols[] = "pairs|liprf";
inline constexpr size_t kMostMethods = 6;

struct StudyOptions {
  std::string protocol = "pairs";
  std::string question = "Which film do you prefer?";
  std::vector<std::string> names;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind(
        "protocol", protocol,
        {.help = "pairs shows every two methods of every clip; liprf shows all methods at once "
                 "and asks for the favourite, as LipRF's study of 16 clips and 35 volunteers",
         .choices = kStudyProtocols});
    bind("question", question, {.help = "what each choice answers"});
    bind("name", names,
         {.help = "name of a method in the answers, once for each in their order; by default "
                  "the name of its file or folder"});
  }
};

struct MadeStudy {
  std::string html, id;
  std::vector<std::string> methods;
  std::vector<std::string> clips;
};

// `methods` are films, or folders with films of the same names, one for each clip; a run's
// folder stands for its styled.mp4. The page has their bytes, without names of files, and draws
// orders and places in the browser. The same films and options give the same page.
//
// Errors: kUsage for fewer than two methods or a wrong number of names, kInput for what is not
// MP4 or WebM, for a clip that another method lacks, and above 200 MB in all.
MadeStudy MakeStudy(const std::vector<std::string>& methods, const StudyOptions& options);

}  // namespace regrade
