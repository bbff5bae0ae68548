#include "pipeline/program/option_binding.h"

#include <gtest/gtest.h>

#include <clocale>
#include <locale>

#include "pipeline/commands/command.h"
#include "pipeline/program/nearest_name.h"
#include "tests/support/expect_error.h"

namespace regrade {
namespace {

struct Sample {
  bool flag = false;
  bool quiet = true;
  int rays = 4096;
  int64_t big = 1;
  uint64_t seed = 0;
  float step = 0.1f;
  double rate = 1e-3;
  std::string name = "none";
  std::string method = "mkl";
  std::string stage;
  std::vector<int> sizes = {64, 128};

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("flag", flag, {.help = "switches"});
    bind("quiet", quiet, {.help = "switches off"});
    bind("rays", rays, {.unit = "rays", .help = "in a step", .min = 64, .max = 1 << 22});
    bind("big", big, {});
    bind("seed", seed, {});
    bind("step", step, {.unit = "voxels", .help = "along a ray", .min = 0.1, .max = 4});
    bind("rate", rate, {.min = 0});
    bind("name", name, {});
    bind("method", method, {.choices = "mkl|reinhard"});
    bind("stage", stage, {.choices = "|pose|render"});
    bind("sizes", sizes, {.min = 8, .max = 1024});
  }
};

class Options : public ::testing::Test {
 protected:
  std::vector<std::string> Parse(const std::vector<std::string>& arguments) {
    sample_ = Sample();
    set_ = OptionSet();
    set_.Add("Sample", &sample_);
    auto words = set_.Parse(arguments);
    set_.ApplyFlags();
    return words;
  }
  Sample sample_;
  OptionSet set_;
};

TEST_F(Options, AllFormsOfValues) {
  const auto words = Parse({"photos", "--rays", "100", "--step=2.5", "--flag", "--no-quiet",
                            "--name", "two words", "--sizes", "32,64,96", "--seed",
                            "18446744073709551615", "--big=-5", "more"});
  EXPECT_EQ(words, (std::vector<std::string>{"photos", "more"}));
  EXPECT_EQ(sample_.rays, 100);
  EXPECT_EQ(sample_.step, 2.5f);
  EXPECT_TRUE(sample_.flag);
  EXPECT_FALSE(sample_.quiet);
  EXPECT_EQ(sample_.name, "two words");
  EXPECT_EQ(sample_.sizes, (std::vector<int>{32, 64, 96}));
  EXPECT_EQ(sample_.seed, ~uint64_t{0});
  EXPECT_EQ(sample_.big, -5);
  EXPECT_EQ(set_.Given("rays"), "100");
  EXPECT_EQ(set_.Given("rate"), std::nullopt);
}

TEST_F(Options, SwitchesDoNotSwallowWords) {
  EXPECT_EQ(Parse({"--flag", "photos"}), std::vector<std::string>{"photos"});
  EXPECT_REGRADE_ERROR(Parse({"--flag=yes"}), ExitCode::kUsage, "--flag");
}

TEST_F(Options, TwoDashesEndTheFlags) {
  EXPECT_EQ(Parse({"--flag", "--", "--rays", "-x"}),
            (std::vector<std::string>{"--rays", "-x"}));
  EXPECT_REGRADE_ERROR(Parse({"-x"}), ExitCode::kUsage, "after --");
}

TEST_F(Options, F18_UnknownNamesSuggestTheNearest) {
  EXPECT_REGRADE_ERROR(Parse({"--raysz", "1"}), ExitCode::kUsage, "did you mean --rays?");
  EXPECT_REGRADE_ERROR(Parse({"--methdo=mkl"}), ExitCode::kUsage, "did you mean --method?");
  EXPECT_REGRADE_ERROR(Parse({"--frobnicate"}), ExitCode::kUsage, "see --help");
  EXPECT_REGRADE_ERROR(Parse({"--ray", "100"}), ExitCode::kUsage, "--rays");  // no guessing
}

TEST_F(Options, F18_MissingValuesAndDuplicates) {
  EXPECT_REGRADE_ERROR(Parse({"--rays"}), ExitCode::kUsage, "--rays: its value is missing");
  EXPECT_REGRADE_ERROR(Parse({"--rays="}), ExitCode::kUsage, "--rays: its value is missing");
  EXPECT_REGRADE_ERROR(Parse({"--rays", "--flag"}), ExitCode::kUsage, "--rays");
  EXPECT_REGRADE_ERROR(Parse({"--rays", "99", "--rays", "99"}), ExitCode::kUsage,
                       "given twice");
  EXPECT_REGRADE_ERROR(Parse({"--flag", "--no-flag"}), ExitCode::kUsage, "given twice");
}

TEST_F(Options, F19_NumbersThatAreNot) {
  for (const char* text : {"NaN", "nan", "inf", "-inf", "1e999", "-1e999", "0x10", "12abc",
                           " 1", "1 ", "1,5", "+1", "1e", "--", "1.5.2", "63", "4194305"})
    EXPECT_REGRADE_ERROR(Parse({std::string("--rays=") + text}), ExitCode::kUsage,
                         "give 64 to 4194304, a whole number");
  for (const char* text : {"NaN", "inf", "1e999", "0x1p3", "0.05", "4.001", "1f", "0,5"})
    EXPECT_REGRADE_ERROR(Parse({std::string("--step=") + text}), ExitCode::kUsage,
                         "give 0.1 to 4");
  EXPECT_REGRADE_ERROR(Parse({"--seed=-1"}), ExitCode::kUsage, "--seed");
  EXPECT_REGRADE_ERROR(Parse({"--seed=18446744073709551616"}), ExitCode::kUsage, "--seed");
  EXPECT_REGRADE_ERROR(Parse({"--sizes=64,,128"}), ExitCode::kUsage, "8 to 1024");
  EXPECT_REGRADE_ERROR(Parse({"--sizes=64,4"}), ExitCode::kUsage, "8 to 1024");
  EXPECT_REGRADE_ERROR(Parse({"--method=wct"}), ExitCode::kUsage, "give one of mkl, reinhard");
  Parse({"--step=0.1"});  // a bound itself, though 0.1f is not 0.1
  EXPECT_EQ(sample_.step, 0.1f);
}

struct CommaDecimals : std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
  char do_thousands_sep() const override { return '.'; }
  std::string do_grouping() const override { return "\3"; }
};

TEST_F(Options, F20_ACommaLocaleChangesNothing) {
  // C's locale where the system has one, and C++'s.
  for (const char* name : {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8"})
    if (std::setlocale(LC_ALL, name) != nullptr) break;
  const std::locale before = std::locale::global(std::locale(std::locale(), new CommaDecimals));
  Parse({"--step", "2.5", "--rate=1e-4", "--rays=100000"});
  EXPECT_EQ(sample_.step, 2.5f);
  EXPECT_EQ(DumpJson(set_.Values().At("rate"), -1), "0.0001");
  EXPECT_EQ(DumpJson(set_.Values().At("rays"), -1), "100000");
  EXPECT_EQ(ParseJson("2.5", "text").AsDouble(), 2.5);
  EXPECT_NE(set_.Help().find("default 2.5"), std::string::npos);
  EXPECT_REGRADE_ERROR(Parse({"--rays=1"}), ExitCode::kUsage, "64 to 4194304");
  std::locale::global(before);
  std::setlocale(LC_ALL, "C");
}

TEST_F(Options, ValuesFeedBackToTheSameValues) {
  Parse({"--rays", "100", "--step=0.3", "--sizes=9", "--name=x y", "--flag"});
  const std::string text = DumpJson(set_.Values());
  EXPECT_NE(text.find("\"step\": 0.3,"), std::string::npos) << text;  // not 0.30000001
  Sample other;
  OptionSet again;
  again.Add("Sample", &other);
  again.ApplyConfig(ParseJson(text, "run.json"), "run.json");
  EXPECT_EQ(DumpJson(again.Values()), text);
  EXPECT_EQ(other.step, 0.3f);
  EXPECT_TRUE(other.flag);
}

TEST_F(Options, F22_ConfigErrorsNameLineAndColumn) {
  Parse({});
  EXPECT_REGRADE_ERROR(
      set_.ApplyConfig(ParseJson("{\n  \"rays\": 100,\n  \"rayz\": 1}", "c"), "c.json"),
      ExitCode::kUsage, "c.json:3:");
  EXPECT_REGRADE_ERROR(set_.ApplyConfig(ParseJson("{\"rays\": 1}", "c"), "c.json"),
                       ExitCode::kUsage, "64 to 4194304");
  EXPECT_REGRADE_ERROR(set_.ApplyConfig(ParseJson("{\"rays\": 100.5}", "c"), "c.json"),
                       ExitCode::kUsage, "c.json:1:");
  EXPECT_REGRADE_ERROR(set_.ApplyConfig(ParseJson("[1]", "c"), "c.json"), ExitCode::kUsage,
                       "an object");
}

TEST_F(Options, HelpHasUnitDefaultAndBounds) {
  Parse({});
  const std::string help = set_.Help();
  EXPECT_NE(help.find("in a step (rays, 64 to 4194304, default 4096)"), std::string::npos)
      << help;
  EXPECT_NE(help.find("--method mkl|reinhard"), std::string::npos);
  EXPECT_NE(help.find("default 64,128"), std::string::npos);
  EXPECT_NE(help.find("--stage pose|render"), std::string::npos);  // none is no choice
  EXPECT_EQ(help.find("required"), std::string::npos);
}

TEST_F(Options, HelpNamesWhatACommandRequires) {
  Parse({});
  const std::string help = set_.Help({"stage"});
  const size_t stage = help.find("--stage");
  EXPECT_NE(help.find("(required)", stage), std::string::npos) << help;
  EXPECT_EQ(help.find("(default none)", stage), std::string::npos);
  using Names = std::vector<std::string>;
  EXPECT_EQ(RequiredOptions("DIR --style PICTURE --out DIR [OPTIONS]"),
            (Names{"style", "out"}));
  EXPECT_EQ(RequiredOptions("DIR --out DIR [--style PICTURE] [OPTIONS] | --frames DIR"),
            (Names{"out"}));
  EXPECT_EQ(RequiredOptions("DIR [OPTIONS] | --frames DIR"), Names{});
}

TEST(NearestName, EditsAndBeginnings) {
  EXPECT_EQ(EditDistance("kitten", "sitting"), 3);
  EXPECT_EQ(EditDistance("abcd", "abdc"), 1);
  EXPECT_EQ(EditDistance("", "abc"), 3);
  EXPECT_EQ(NearestName("recon", {"run", "reconstruct", "render"}), "reconstruct");
  EXPECT_EQ(NearestName("psoe", {"pose", "run"}), "pose");
  EXPECT_EQ(NearestName("zzzzzz", {"pose", "run"}), "");
}

}  // namespace
}  // namespace regrade
