// regrade clean: removes from a run's folder what can be made again, after a yes.
#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "kernels/base/error.h"
#include "pipeline/commands/command.h"
#include "pipeline/program/console.h"
#include "pipeline/workspace/folder_size.h"
#include "pipeline/workspace/output_names.h"
#include "pipeline/workspace/style_folders.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

struct CleanOptions {
  bool yes = false;
  bool dry_run = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("yes", yes, {.help = "removes without asking"});
    bind("dry-run", dry_run, {.help = "prints what could be removed, and removes nothing"});
  }
};

struct Removable {
  std::string path;  // relative to the output folder
  const char* how;   // it is made again
};

// Films, reports, networks, poses and fields stay.
std::vector<Removable> RemovableIn(const std::string& folder) {
  std::vector<Removable> all = {
      {".regrade/work", "not needed any more"},
      {kBlocksFolder, "`regrade refine` makes them again"},
      {".regrade/checkpoints", "a stage that was interrupted would begin from its start"}};
  const std::vector<std::string> learned = LearnedStyles(folder);
  for (const std::string& name : StyleNames(folder)) {
    const bool is_learned = std::ranges::find(learned, name) != learned.end();
    const std::string style = std::string(kStylesFolder) + "/" + name;
    Workspace::RefuseLinks(StyleFolder(folder, name));
    all.push_back({style + "/frames", is_learned
                                          ? "`regrade render` makes them again"
                                          : "the style is not finished, and makes them again"});
    all.push_back({style + "/" + kPartsFolder, "`regrade render --part` makes them again"});
    all.push_back(
        {style + "/field_2d.npz", "made again by `regrade evaluate --controls field`"});
    all.push_back({style + "/styled.npz", "of an earlier version; `regrade export` writes it"});
    all.push_back({style + "/.regrade/checkpoints",
                   "a stage that was interrupted would begin from its start"});
  }
  std::erase_if(all,
                [&](const Removable& r) { return SizeOnDisk(folder + "/" + r.path) == 0; });
  return all;
}

}  // namespace

void RunClean(const Command& command, const Arguments& arguments, Console* console) {
  CleanOptions clean;
  ProgramOptions program;
  OptionSet options;
  options.Add("Clean", &clean);
  options.Add("Program", &program);
  const auto prepared = Prepare(command, arguments, {}, &options);
  if (!prepared) return;
  const std::string& folder = prepared->words[0];
  if (!Workspace::Exists(folder))
    throw InputError("no run has worked in this folder", folder, "name the folder of a run");
  Workspace workspace(folder);  // nobody else works in it
  const std::vector<Removable> removable = RemovableIn(folder);
  uint64_t sum = 0;
  for (const Removable& r : removable) {
    const uint64_t bytes = SizeOnDisk(folder + "/" + r.path);
    sum += bytes;
    console->Info(SizeText(bytes) + "  " + r.path + ": " + r.how);
  }
  console->Info(SizeText(sum) + " of " + SizeText(SizeOnDisk(folder)) + " can be made again");
  if (clean.dry_run || removable.empty()) return;
  if (!clean.yes && !AnsweredYes("remove them?")) {
    console->Info("nothing was removed");
    return;
  }
  for (const Removable& r : removable) {
    std::error_code error;
    fs::remove_all(folder + "/" + r.path, error);
    if (error) throw ResourceError(error.message(), folder + "/" + r.path);
  }
  // A workspace has this folder.
  fs::create_directories(folder + "/.regrade/checkpoints");
  console->Info("removed " + SizeText(sum));
}

}  // namespace regrade
