// regrade page: the scene and its styles as one page that a browser opens without a server.
#include "kernels/base/error.h"
#include "pipeline/commands/page_styles.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/text.h"
#include "pipeline/page/make_page.h"
#include "pipeline/workspace/style_folders.h"

namespace regrade {
namespace {

struct PageFileOptions {
  std::string out;
  bool dry_run = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("out", out, {.help = "the page to write, such as scene.html"});
    bind("dry-run", dry_run, {.help = "prints what would be done, and does nothing"});
  }
};

}  // namespace

void RunPage(const Command& command, const Arguments& arguments, Console* console) {
  PageFileOptions file;
  PageOptions page;
  ProgramOptions program;
  OptionSet options;
  options.Add("Page", &file);
  options.Add("Page", &page);
  options.Add("Program", &program);
  const auto prepared =
      Prepare(command, arguments, {.most_words = 1 + kMostPageStyles}, &options);
  if (!prepared) return;
  const std::string& folder = prepared->words[0];
  std::vector<std::string> left;
  const std::vector<std::string> styles = WantedStyles(folder, prepared->words, &left);
  if (!left.empty()) console->Info(LeftOutText(folder, left));
  if (!file.dry_run) RequireValue(file.out, "--out", "name the page to write");
  if (file.dry_run) {
    console->Info(Concat("the scene and ", Counted(std::ssize(styles), "style"),
                         " would be written as a page"));
    return;
  }
  console->BeginStage("page");
  const MadePage made = MakePage(folder, styles, page, console->StageProgress());
  console->EndStage();
  WriteFileAtomically(file.out, made.html);
  for (const std::string& line : made.report) console->Info(line);
  const double megabytes = static_cast<double>(made.html.size()) / 1e6;
  console->Info(Concat(
      "wrote ", file.out, ": ", Format("%.1f", megabytes), " MB, ", made.splats, " splats of ",
      Format("%.2f", static_cast<double>(made.field_bytes) / static_cast<double>(made.splats)),
      " bytes, ", Counted(std::ssize(styles), "style")));
  for (size_t i = 0; i < styles.size(); ++i)
    console->Info(Concat("  ", styles[i], ": ", (made.style_bytes[i] + 999) / 1000, " kB"));
  console->Info(Concat(
      "The page is a copy of the place: whoever has it can look around there. Small "
      "pictures of the photos are in it, their metadata are not; ",
      page.names == "off" ? "nor are names." : "names are, and --names off leaves them out."));
}

}  // namespace regrade
