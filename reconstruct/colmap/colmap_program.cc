#include "reconstruct/colmap/colmap_program.h"

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <filesystem>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr const char* kInstall =
    "install COLMAP 3.7 or newer (Debian, Ubuntu: apt install colmap), or give its path with "
    "--config '{\"colmap\":\"PATH\"}', or start from a capture that has poses";

// Options renamed by COLMAP 3.12: {in 3.8, since 3.12}.
constexpr std::pair<const char*, const char*> kRenamed[] = {
    {"SiftExtraction.use_gpu", "FeatureExtraction.use_gpu"},
    {"SiftExtraction.num_threads", "FeatureExtraction.num_threads"},
    {"SiftExtraction.max_image_size", "FeatureExtraction.max_image_size"},
    {"SiftMatching.use_gpu", "FeatureMatching.use_gpu"},
    {"SiftMatching.num_threads", "FeatureMatching.num_threads"},
    {"BundleAdjustment.function_tolerance", "BundleAdjustmentCeres.function_tolerance"},
};

// COLMAP's Qt aborts without a display. Its log files go to its TMPDIR, whatever the flags of
// its log say.
const std::vector<std::pair<std::string, std::string>> kEnvironment = {
    {"QT_QPA_PLATFORM", "offscreen"}, {"GLOG_logtostderr", "1"}};

bool IsPathOption(const std::string& name) { return name.ends_with("_path"); }

bool IsGpuOption(const std::string& name) { return name.ends_with(".use_gpu"); }

bool ReportsFullDisk(const std::string& line) {
  return line.find("disk is full") != std::string::npos ||
         line.find("No space left on device") != std::string::npos ||
         line.find("disk I/O error") != std::string::npos;
}

// Absolute, because a path that begins with a dash would be parsed as an option.
std::string Absolute(const std::string& path) {
  return std::filesystem::absolute(path).string();
}

const char* LikelyCause(const ChildResult& result) {
  if (result.TimedOut())
    return "raise pose-time-limit by --config if there are many photos or the machine is slow";
  if (result.signal == SIGKILL)
    return "the system killed it, probably because memory ran out: close other programs, or "
           "lower the constant pose-image-size (--config)";
  if (result.signal == SIGILL) return "this colmap was built for another kind of processor";
  if (result.signal != 0 || result.exit_status >= 128) return "COLMAP crashed; see its log";
  return "see its log";
}

}  // namespace

ColmapProgram::ColmapProgram(const std::string& program, const std::string& log_folder,
                             const std::string& gpu)
    : program_(program.find('/') == std::string::npos ? program : Absolute(program)),
      log_folder_(log_folder) {
  ChildOptions options{.argv = {program_, "help"},
                       .environment = kEnvironment,
                       .temporary_parent = log_folder_,
                       .wall_limit_s = 60};
  options.log_path = LogPath("help");
  int major = 0, minor = 0;
  bool found = false, has_cuda = false;
  const LineFunction read_version = [&](const std::string& line) {
    found = found || std::sscanf(line.c_str(), "COLMAP %d.%d", &major, &minor) == 2;
    has_cuda = has_cuda || line.find("with CUDA") != std::string::npos;
  };
  ChildResult result;
  try {
    result = RunChild(options, read_version);
  } catch (const Error& e) {
    if (e.code() != ExitCode::kExternalProgram) throw;
    throw ProgramError(e.what_failed(), program, kInstall);
  }
  if (!found) {
    const std::string first =
        result.last_lines.empty() ? "it printed nothing" : "it printed:" + result.LastLines();
    throw ProgramError(
        "this is not COLMAP, or it does not work (" + result.Describe() + "; " + first + ")",
        program, kInstall);
  }
  version_ = Concat(major, ".", minor);
  if (std::pair(major, minor) < std::pair(3, 7))
    throw ProgramError("COLMAP " + version_ + " is too old (3.7 and newer are supported)",
                       program, kInstall);
  if (gpu == "on" && !has_cuda)
    throw ProgramError("this COLMAP was built without CUDA", program,
                       "leave colmap-gpu at auto, or put a COLMAP with CUDA first on PATH");
  use_gpu_ = gpu != "off" && has_cuda;
  may_fall_back_ = gpu == "auto";
}

ChildResult ColmapProgram::Run(const std::string& command, const ColmapArguments& arguments,
                               const std::string& log_name, const Limits& limits,
                               const LineFunction& on_line,
                               const KeepGoingFunction& keep_going) {
  const bool on_gpu = use_gpu_ && std::ranges::any_of(arguments, [](const auto& argument) {
                        return IsGpuOption(argument.first);
                      });
  ChildResult result = RunOnce(command, arguments, log_name, limits, on_line, keep_going);
  if (!on_gpu || !may_fall_back_ || result.Succeeded() || result.TimedOut()) return result;
  notes_.push_back("colmap " + command + " failed on the GPU (" + result.Describe() +
                   "); COLMAP goes on with the CPU");
  use_gpu_ = false;
  return RunOnce(command, arguments, log_name, limits, on_line, keep_going);
}

ChildResult ColmapProgram::RunOnce(const std::string& command, const ColmapArguments& arguments,
                                   const std::string& log_name, const Limits& limits,
                                   const LineFunction& on_line,
                                   const KeepGoingFunction& keep_going) {
  ChildOptions options;
  options.argv = CommandLine(command, arguments);
  options.environment = kEnvironment;
  options.temporary_parent =
      log_folder_;  // what a killed run leaves there, the next one removes
  options.wall_limit_s = limits.wall_s;
  options.quiet_limit_s = limits.quiet_s;
  options.log_path = LogPath(log_name);
  bool disk_full = false;
  const ChildResult result = RunChild(
      options,
      [&](const std::string& line) {
        disk_full = disk_full || ReportsFullDisk(line);
        if (on_line) on_line(line);
      },
      keep_going);
  if (result.end == ChildEnd::kStopped) throw Interrupted();
  if (disk_full)
    throw ResourceError("the disk is full (colmap " + command + ")", log_folder_,
                        "free some space; COLMAP needs about 1 MB per photo");
  return result;
}

void ColmapProgram::Fail(const std::string& command, const ChildResult& result,
                         const std::string& log_name) const {
  std::string what = "colmap " + command + " failed: " + result.Describe();
  if (!result.last_lines.empty()) what += "; its last lines were:" + result.LastLines();
  throw ProgramError(what, LogPath(log_name), LikelyCause(result));
}

const std::set<std::string>& ColmapProgram::OptionsOf(const std::string& command) {
  const auto it = options_.find(command);
  if (it != options_.end()) return it->second;
  std::set<std::string>& names = options_[command];
  ChildOptions options{.argv = {program_, command, "-h"},
                       .environment = kEnvironment,
                       .temporary_parent = log_folder_,
                       .wall_limit_s = 60};
  RunChild(options, [&](const std::string& line) {
    const size_t begin = line.find("--");
    if (begin == std::string::npos) return;
    const size_t end = line.find_first_of(" =", begin);
    names.insert(line.substr(begin + 2, end == std::string::npos ? end : end - begin - 2));
  });
  return names;
}

std::vector<std::string> ColmapProgram::CommandLine(const std::string& command,
                                                    const ColmapArguments& arguments) {
  const std::set<std::string>& known = OptionsOf(command);
  std::vector<std::string> argv = {program_, command};
  for (const auto& [name, value] : arguments) {
    std::string option = name;
    for (const auto& [before, now] : kRenamed)
      if (name == before && known.count(name) == 0) option = now;
    if (IsPathOption(name)) {
      argv.insert(argv.end(), {"--" + name, Absolute(value)});
    } else if (known.count(option) > 0) {
      argv.insert(argv.end(), {"--" + option, IsGpuOption(name) && use_gpu_ ? "1" : value});
    }
  }
  return argv;
}

std::string ColmapProgram::LogPath(const std::string& log_name) const {
  return log_folder_ + "/" + log_name + ".log";
}

}  // namespace regrade
