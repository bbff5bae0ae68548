// regrade view: the page of a scene, served to a browser on this machine, which learns styles
// from pictures that are dropped on it.
#include <fcntl.h>
#include <omp.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <future>
#include <optional>
#include <thread>

#include "kernels/base/error.h"
#include "pipeline/commands/command.h"
#include "pipeline/commands/page_styles.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/page/make_page.h"
#include "pipeline/page/view_session.h"
#include "pipeline/program/interrupt.h"
#include "pipeline/report/html_text.h"
#include "pipeline/run/resolve_settings.h"
#include "pipeline/run/run_settings.h"
#include "pipeline/workspace/style_folders.h"
#include "pipeline/workspace/workspace.h"

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

// In a session of its own, which stays when this program ends; nobody waits for it.
void StartBrowser(const std::string& file, Console* console) {
  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
  if (::posix_spawn_file_actions_init(&actions) != 0 ||
      ::posix_spawnattr_init(&attributes) != 0)
    throw ResourceError("out of memory");
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    ::posix_spawn_file_actions_addopen(&actions, fd, "/dev/null", O_RDWR, 0);
  ::posix_spawn_file_actions_addclosefrom_np(&actions, STDERR_FILENO + 1);
  sigset_t all;
  ::sigfillset(&all);
  ::posix_spawnattr_setsigdefault(&attributes, &all);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGDEF);
  std::string program = "xdg-open", path = file;
  char* const words[] = {program.data(), path.data(), nullptr};
  pid_t browser = 0;
  const int status = ::posix_spawnp(&browser, words[0], &actions, &attributes, words, environ);
  ::posix_spawn_file_actions_destroy(&actions);
  ::posix_spawnattr_destroy(&attributes);
  if (status != 0)
    console->Warn(Concat("no browser was opened: xdg-open: ", std::strerror(status)));
}

// A folder in which a run has begun gets its scene later; styles that are named are not there
// before it.
bool MayWait(const std::string& folder, const Arguments& words) {
  return words.size() == 1 && Workspace::Exists(folder);
}

// Before the address is printed, where the scene is there. Throws Error(kInput).
void RequireSplats(const std::string& folder) {
  const std::string field = folder + "/field.npz";
  if (fs::exists(field) && CountSplats(field) == 0)
    throw InputError("is a scene of voxels, which has no page", field, kNoPage);
}

// False if the program is to end.
bool AwaitScene(const std::string& folder, ViewSession* session, Console* console) {
  const auto is_there = [&folder] { return fs::exists(folder + "/field.npz"); };
  if (is_there()) return true;
  const std::string awaited =
      folder +
      " has no scene yet. It opens here when a run has fitted it; where no run is working, "
      "start its command again";
  session->SayWhatIsAwaited(awaited + ".");
  console->Info(awaited);
  while (!is_there()) {
    if (StopRequested()) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
  return true;
}

// Flags for `regrade stylize` in place of what run.json would run or read outside of the
// folder, which may come from somebody else: a page does none of that.
std::vector<std::string> FlagsWithoutOutside(const std::string& folder, Console* console) {
  const std::string run_json = folder + "/run.json";
  if (!fs::exists(run_json)) return {};
  RunSettings settings;
  OptionSet options;
  settings.Bind(&options);
  const JsonValue plain = options.Values();
  JsonValue without = JsonValue::Object();
  std::string named;
  const auto refuse = [&](const OutsideOptions& outside) {
    for (const OptionSet::Outside& option : outside) {
      named += " --" + option.name + " '" + option.text + "'";
      without[option.name] = plain.At(option.name);
    }
    return false;
  };
  ResolveSettings({.run_json = run_json, .folder = folder, .accept_outside = refuse}, &options);
  if (named.empty()) return {};
  console->Warn(run_json +
                " names what would be run or read elsewhere; the page goes on without:" +
                named + ". `regrade stylize` asks for it");
  return {"--config", DumpJson(without, -1)};
}

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
  if (!MayWait(folder, prepared->words)) WantedStyles(folder, prepared->words);  // throws
  RequireSplats(folder);
  ViewSession session(AbsolutePath(folder), FlagsWithoutOutside(folder, console));
  LocalServer server(session.Routes(), MakeToken());
  console->Info("open " + server.Address());
  console->Info(
      "The address is for this machine and for whoever has it: ssh -L carries it elsewhere. "
      "Ctrl-C ends it.");
  std::optional<OpeningFile> file;
  if (view.browse) {
    file.emplace(server.Address());
    StartBrowser(file->path(), console);
  }
  // Beside the server, which says meanwhile what it waits for. This thread prints nothing.
  std::atomic<bool> failed = false;
  const int threads = omp_get_max_threads();  // a number that each thread has of its own
  std::future<void> page = std::async(std::launch::async, [&] {
    omp_set_num_threads(threads);
    try {
      if (!AwaitScene(folder, &session, console)) return;
      std::vector<std::string> left;
      const std::vector<std::string> styles = WantedStyles(folder, prepared->words, &left);
      if (!left.empty()) console->Info(LeftOutText(folder, left));
      console->BeginStage("page");
      session.MakePageOf(styles, console->StageProgress());
      console->EndStage();
      if (styles.empty())
        console->Info(
            "the scene has no style yet; `regrade view` shows those there are when it starts");
    } catch (...) {
      failed = true;
      throw;
    }
  });
  server.Run([&] {
    session.CheckFolder();
    return !StopRequested() && !failed;
  });
  page.get();
  console->Info("stopped");
}

}  // namespace regrade
