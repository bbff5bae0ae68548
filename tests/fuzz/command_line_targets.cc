// Fuzz targets: options, the template of a style command, and printed names.
#include <algorithm>

#include "pipeline/program/console.h"
#include "pipeline/report/html_text.h"
#include "pipeline/run/run_settings.h"
#include "pipeline/stages/command_stylizer.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/mutate.h"

namespace regrade::testing {
namespace {

// One word per line.
std::vector<std::string> Words(std::string_view bytes) {
  std::vector<std::string> words(1);
  for (const char c : bytes) c == '\n' ? words.emplace_back() : words.back() += c;
  return words;
}

std::vector<std::string> OptionSeeds() {
  return {
      "photos\n--out\nx\n--seed=7\n--reproducible\n--field=splats\n--splat-steps\n10\n--no-"
      "json",
      "--threads\n2\n--fps\n24.5\n--\n--not-an-option", "--preset\ndraft\n--effects\nndc=off"};
}

bool ReadOptions(std::string_view bytes) {
  const std::vector<std::string> words = Words(bytes);
  return Accepts([&words] {
    RunSettings settings, again;
    OptionSet options, others;
    settings.Bind(&options);
    options.Parse(words);
    options.ApplyFlags();
    again.Bind(&others);
    others.ApplyConfig(options.Values(), "again");
    FuzzRequire(others.Values() == options.Values(), "run.json says what was typed");
    FuzzRequire(!options.Help().empty(), "help can be printed");
  });
}

std::string MutateOptions(std::string text, FuzzRandom* random) {
  static const std::vector<std::string> kWords = {"\n",
                                                  "--",
                                                  "--splat-steps\n",
                                                  "--photo-size\n",
                                                  "=",
                                                  ",",
                                                  "--no-",
                                                  "-",
                                                  "--seed\n",
                                                  "--out\n",
                                                  "--out=",
                                                  "--help",
                                                  "--preset\n",
                                                  "paper",
                                                  "--method\n",
                                                  "mkl",
                                                  "--threads\n",
                                                  "true",
                                                  "--masks\n",
                                                  "--fps=",
                                                  "--max-memory\n",
                                                  "\xff",
                                                  "--json",
                                                  "--gaps\n1,5"};
  return MutateText(std::move(text), kWords, random);
}

std::vector<std::string> CommandSeeds() {
  return {"program \"a b\" 'c' {input} {output}", "x", " \t "};
}

bool ReadCommand(std::string_view bytes) {
  return Accepts([bytes] {
    size_t letters = 0;
    for (const std::string& word : SplitCommand(std::string(bytes))) letters += word.size();
    FuzzRequire(letters <= bytes.size(), "words hold what was typed");
  });
}

std::string MutateCommand(std::string text, FuzzRandom* random) {
  static const std::vector<std::string> kWords = {
      "\"", "'", " ", "\t", "{input}", "{style}", "$(x)", "\\", "|", "\"\"", "''"};
  return MutateText(std::move(text), kWords, random);
}

std::vector<std::string> NameSeeds() {
  return {"a photo.jpg", "\x1b[31mred", "<script>&\"'",
          "\xe2\x80\xae"
          "gpj.exe",
          "\xff\xc3"};
}

// Every name can be printed.
bool ShowName(std::string_view bytes) {
  const std::vector<char> own(bytes.begin(), bytes.end());
  const std::string_view name(own.data(), own.size());
  const auto harmless = [](char c) { return static_cast<unsigned char>(c) >= 32 && c != 127; };
  const std::string shown = Printable(std::string(name)), html = EscapeHtml(name);
  FuzzRequire(std::all_of(shown.begin(), shown.end(), harmless), "nothing steers a terminal");
  FuzzRequire(html.find_first_of("<>\"'") == std::string::npos, "nothing is markup");
  FuzzRequire(ShellCommand({std::string(name)}).find('\0') == std::string::npos ||
                  name.find('\0') != std::string_view::npos,
              "a command line is text");
  return true;
}

std::string MutateName(std::string bytes, FuzzRandom* random) {
  return MutateBytes(std::move(bytes), random);
}

}  // namespace

std::vector<FuzzTarget> CommandLineTargets() {
  return {{"options", OptionSeeds, ReadOptions, MutateOptions, 2000},
          {"style_command", CommandSeeds, ReadCommand, MutateCommand, 100000},
          {"names", NameSeeds, ShowName, MutateName, 100000}};
}

}  // namespace regrade::testing
