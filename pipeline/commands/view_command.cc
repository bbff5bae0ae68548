// regrade view: the page of a scene, served to a browser on this machine, which learns styles
// from pictures that are dropped on it.
#include <stdlib.h>

#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/process/child_process.h"
#include "pipeline/commands/command.h"
#include "pipeline/commands/page_styles.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/program/interrupt.h"
#include "pipeline/report/html_text.h"
#include "pipeline/view/view_session.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr char kOpenOption[] = "open";

struct ViewOptions {
  bool browse = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind(kOpenOption, browse, {.help = "opens the page in the browser"});
  }
};

// A file that leads the browser to the address: on a command line others could read the token.
class OpeningFile {
 public:
  explicit OpeningFile(const std::string& address) {
    folder_ = (fs::temp_directory_path() / "regrade-view-XXXXXX").string();
    if (::mkdtemp(folder_.data()) == nullptr)  // for this user only
      throw ResourceError("cannot make a temporary folder", folder_,
                          "set TMPDIR to a disk with space");
    WriteFileAtomically(path(),
                        "<!doctype html><meta charset=\"utf-8\"><meta name=\"referrer\" "
                        "content=\"no-referrer\"><meta http-equiv=\"refresh\" "
                        "content=\"0;url=" +
                            EscapeHtml(address) + "\">");
  }
  ~OpeningFile() {
    std::error_code error;
    fs::remove_all(folder_, error);
  }
  OpeningFile(const OpeningFile&) = delete;
  OpeningFile& operator=(const OpeningFile&) = delete;
  std::string path() const { return folder_ + "/open.html"; }

 private:
  std::string folder_;
};

}  // namespace

void RunView(const Command& command, const Arguments& arguments, Console* console) {
  ViewOptions view;
  ProgramOptions program;
  OptionSet options;
  options.Add("View", &view);
  options.Add("Program", &program);
  const auto prepared =
      Prepare(command, arguments, {.most_words = 1 + kMostPageStyles}, &options);
  if (!prepared) return;
  const std::string& folder = prepared->words[0];
  const std::vector<std::string> styles = WantedStyles(folder, prepared->words);
  console->BeginStage("page");
  ViewSession session(AbsolutePath(folder), styles, console->StageProgress());
  console->EndStage();
  LocalServer server(session.Routes(), MakeToken());
  console->Info("open " + server.Address());
  console->Info(
      "The address is for this machine and for whoever has it: ssh -L carries it elsewhere. "
      "Ctrl-C ends it.");
  std::optional<OpeningFile> file;
  if (view.browse) {
    file.emplace(server.Address());
    const ChildResult opened =
        RunChild({.argv = {"xdg-open", file->path()}, .wall_limit_s = 20});
    if (!opened.Succeeded()) console->Warn("no browser was opened: " + opened.Describe());
  }
  server.Run([] { return !StopRequested(); });
  console->Info("stopped");
}

}  // namespace regrade
