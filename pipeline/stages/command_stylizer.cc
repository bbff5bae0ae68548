#include "pipeline/stages/command_stylizer.h"

#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/process/child_process.h"
#include "kernels/process/private_folder.h"
#include "pipeline/images/image_file.h"
#include "pipeline/stages/folder_stylizer.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr char kHint[] =
    "for example command:\"restyle --content {input} --style {style} -o {output}\"";

// One pass from left to right, so that braces in a path stay what they are.
std::string Filled(const std::string& word,
                   const std::vector<std::pair<std::string, std::string>>& values) {
  std::string filled;
  for (size_t i = 0; i < word.size();) {
    const auto value = std::ranges::find_if(
        values, [&](const auto& v) { return word.compare(i, v.first.size(), v.first) == 0; });
    if (value == values.end()) {
      filled += word[i++];
    } else {
      filled += value->second;
      i += value->first.size();
    }
  }
  return filled;
}

class CommandStylizer : public ViewStylizer {
 public:
  CommandStylizer(std::vector<std::string> words, std::string style_path, double limit_s)
      : words_(std::move(words)), style_path_(std::move(style_path)), limit_s_(limit_s) {}

  Image Stylize(const Image& view, int view_index) const override {
    const std::string where = Concat(words_[0], " on view ", view_index);
    CountNotFinite(view, where);
    const PrivateFolder folder;
    const std::string input = folder / "input.png", output = folder / "output.png";
    WritePng8(input, Colors(view));
    ChildOptions options;
    for (const std::string& word : words_)
      options.argv.push_back(
          Filled(word, {{"{input}", input}, {"{style}", style_path_}, {"{output}", output}}));
    options.wall_limit_s = limit_s_;
    const ChildResult result = RunChild(options);
    if (!result.Succeeded())
      throw ProgramError(
          "the style command failed: " + result.Describe() + result.LastLines(), where,
          result.TimedOut() ? "a larger constant style-command-limit (--config) gives it longer"
                            : "run the command by hand on one photo");
    std::error_code error;
    if (!fs::exists(output, error))
      throw ProgramError("the style command left no picture at {output}", where, kHint);
    return WithColors(view, FittedToView(Decoded(output, where), view, where));
  }

  std::string Name() const override { return "command " + words_[0]; }

 private:
  static Image Decoded(const std::string& path, const std::string& where) try {
    DecodeLimits limits;
    limits.min_side = 1;
    return DecodePhoto(path, limits).image;
  } catch (const Error& error) {
    throw ProgramError("what the style command wrote is no picture: " + error.what_failed(),
                       where, kHint);
  }

  std::vector<std::string> words_;
  std::string style_path_;
  double limit_s_;
};

}  // namespace

std::vector<std::string> SplitCommand(const std::string& command) {
  std::vector<std::string> words;
  std::string word;
  bool in_word = false;
  char quote = 0;
  for (const char c : command) {
    if (quote != 0) {
      if (c == quote)
        quote = 0;
      else
        word += c;
    } else if (c == '"' || c == '\'') {
      quote = c;
      in_word = true;
    } else if (c == ' ' || c == '\t' || c == '\n') {
      if (in_word) words.push_back(word);
      word.clear();
      in_word = false;
    } else {
      word += c;
      in_word = true;
    }
  }
  if (quote != 0)
    throw UsageError(std::string("a quote ") + quote + " stays open", "--method", kHint);
  if (in_word) words.push_back(word);
  return words;
}

std::unique_ptr<ViewStylizer> MakeCommandStylizer(const std::string& command,
                                                  const std::string& style_path,
                                                  double limit_s) {
  std::vector<std::string> words = SplitCommand(command);
  for (const char* placeholder : {"{input}", "{output}"})
    if (std::ranges::none_of(words, [&](const std::string& word) {
          return word.find(placeholder) != std::string::npos;
        }))
      throw UsageError(std::string("the style command has no ") + placeholder, "--method",
                       kHint);
  if (words[0].empty()) throw UsageError("the style command has no program", "--method", kHint);
  return std::make_unique<CommandStylizer>(std::move(words), style_path, limit_s);
}

}  // namespace regrade
