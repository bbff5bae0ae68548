// Studies: what goes into a page, and answers that are not to be trusted.
#include <gtest/gtest.h>

#include "pipeline/study/make_study.h"
#include "pipeline/study/study_answers.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::TemporaryFolder;
using testing::WriteText;

const std::string kFilm = std::string("\0\0\0\x18", 4) + "ftypisom and more";

TEST(Study, APageHasTheFilmsAndNoPaths) {
  const TemporaryFolder folder;
  for (const char* name : {"ours", "theirs"})
    for (const char* clip : {"fern", "horns"})
      WriteText(folder / (std::string(name) + "/" + clip + ".mp4"), kFilm + name + clip);
  StudyOptions options{.question = "Which </script> is better?"};
  const MadeStudy made = MakeStudy({folder / "ours", folder / "theirs/"}, options);
  EXPECT_EQ(made.methods, (std::vector<std::string>{"ours", "theirs"}));
  EXPECT_EQ(made.clips, (std::vector<std::string>{"fern", "horns"}));
  EXPECT_EQ(made.html.find(folder / ""), std::string::npos);
  EXPECT_EQ(made.html.find("</script> is"), std::string::npos);
  EXPECT_EQ(made.html.find("@STUDY@"), std::string::npos);
  EXPECT_EQ(MakeStudy({folder / "ours", folder / "theirs"}, options).id, made.id);
  WriteText(folder / "ours/fern.mp4", kFilm + "changed");
  EXPECT_NE(MakeStudy({folder / "ours", folder / "theirs"}, options).id, made.id);
}

TEST(Study, FilmsThatCannotBeCompared) {
  const TemporaryFolder folder;
  WriteText(folder / "a/one.mp4", kFilm);
  WriteText(folder / "b/one.mp4", kFilm);
  WriteText(folder / "b/two.mp4", kFilm);
  WriteText(folder / "empty/notes.txt", "none");
  WriteText(folder / "text.mp4", "not a film");
  WriteText(folder / "film.webm", "\x1a\x45\xdf\xa3 and more");
  WriteText(folder / "film.mp4", kFilm);
  const auto make = [&](const std::string& a, const std::string& b) {
    return MakeStudy({folder / a, folder / b}, {});
  };
  EXPECT_REGRADE_ERROR(make("a", "b"), ExitCode::kInput, "no film of the clip two");
  EXPECT_REGRADE_ERROR(make("a", "empty"), ExitCode::kInput, "there are no films here");
  EXPECT_REGRADE_ERROR(make("film.mp4", "text.mp4"), ExitCode::kInput, "browsers play");
  EXPECT_REGRADE_ERROR(make("film.mp4", "missing.mp4"), ExitCode::kInput, "missing.mp4");
  EXPECT_REGRADE_ERROR(make("film.mp4", "film.webm"), ExitCode::kUsage, "two methods have one");
  StudyOptions named;
  named.names = {"one", "two"};
  EXPECT_REGRADE_ERROR(MakeStudy({folder / "film.mp4", folder / "film.webm"}, named),
                       ExitCode::kInput, "MP4 and WebM");
  named.names = {"one"};
  EXPECT_REGRADE_ERROR(MakeStudy({folder / "a", folder / "a"}, named), ExitCode::kUsage,
                       "2 methods, 1 names");
}

// Two methods, four choices; `answers` in place of them.
std::string Answers(const std::string& participant, const std::string& answers,
                    const std::string& study = "00c0ffee") {
  return R"({"format": "regrade study answers", "version": 1, "study": ")" + study +
         R"(", "protocol": "pairs", "question": "Which?", "methods": ["a", "b"],
          "participant": ")" +
         participant + R"(", "trials": 3, "answers": [)" + answers + "]}";
}

const char kChoseA[] = R"({"clip": "c", "shown": [1, 0], "chosen": 0, "milliseconds": 5})";

TEST(Study, AnswersAreCountedOncePerParticipant) {
  const TemporaryFolder folder;
  const std::string a = kChoseA;
  WriteText(folder / "1.json", Answers("1", a + "," + a + "," + a));
  WriteText(folder / "2.json",
            Answers("2", a + R"(, {"shown": [0, 1], "chosen": 1})"));  // not finished
  WriteText(
      folder / "3.json",
      Answers("3", a + R"(, {"shown": [0, 1], "chosen": 1, "check": true, "passed": false})"));
  const StudyAnswers answers =
      ReadStudyAnswers({folder / "1.json", folder / "2.json", folder / "3.json"});
  EXPECT_EQ(answers.participants.size(), 2u);
  EXPECT_EQ(answers.failed, 1);
  EXPECT_EQ(answers.unfinished, 1);
  const JsonValue analysis = AnalyseStudy(answers);
  EXPECT_EQ(analysis.At("methods").AsArray()[0].At("chosen").AsInt(), 4);
  EXPECT_EQ(analysis.At("pairs").AsArray()[0].At("choices").AsInt(), 5);
  EXPECT_NE(FormatStudy(analysis).find("a over b: 4 of 5"), std::string::npos);
}

TEST(Study, AnswersThatAreNone) {
  const TemporaryFolder folder;
  const auto refused = [&](const std::string& text) {
    WriteText(folder / "bad.json", text);
    WriteText(folder / "good.json", Answers("9", kChoseA));
    return ReadStudyAnswers({folder / "good.json", folder / "bad.json"});
  };
  EXPECT_REGRADE_ERROR(refused("{}"), ExitCode::kInput, "not a file of answers");
  EXPECT_REGRADE_ERROR(refused("[1]"), ExitCode::kInput, "not a file of answers");
  EXPECT_REGRADE_ERROR(refused(Answers("9", kChoseA)), ExitCode::kInput, "in two files");
  EXPECT_REGRADE_ERROR(refused(Answers("1", kChoseA, "0badcafe")), ExitCode::kInput,
                       "another study");
  EXPECT_REGRADE_ERROR(refused(Answers("1", R"({"shown": [0, 2], "chosen": 0})")),
                       ExitCode::kInput, "no method 2");
  EXPECT_REGRADE_ERROR(refused(Answers("1", R"({"shown": [0, 0], "chosen": 0})")),
                       ExitCode::kInput, "two different methods");
  EXPECT_REGRADE_ERROR(refused(Answers("1", R"({"shown": [0], "chosen": 1})")),
                       ExitCode::kInput, "not shown");
  WriteText(folder / "none.json", Answers("1", ""));
  EXPECT_REGRADE_ERROR(ReadStudyAnswers({folder / "none.json"}), ExitCode::kInput,
                       "there is no answer");
}

}  // namespace
}  // namespace regrade
