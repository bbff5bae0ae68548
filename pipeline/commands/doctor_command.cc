// regrade doctor: prints what is installed and which processor runs what.
#include <omp.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/device/device_memory.h"
#include "kernels/field/cpu/rays.h"
#include "kernels/process/child_process.h"
#include "pipeline/commands/command.h"
#include "pipeline/images/libraries.h"
#include "pipeline/program/fetch_file.h"
#include "pipeline/program/memory.h"

namespace regrade {
namespace {

struct Finding {
  std::string name, value, meaning;
};

// COLMAP has no --version: the first lines of its help name it.
Finding FindColmap(const std::string& program) {
  const std::string needed = "needed for `run` and `pose` on photos without poses";
  std::string version;
  bool cuda = false;
  try {
    ChildOptions options;
    options.argv = {program, "help"};
    options.wall_limit_s = 20;
    options.environment = {{"QT_QPA_PLATFORM", "offscreen"}};
    RunChild(options, [&](const std::string& line) {
      if (version.empty() && line.find("COLMAP") != std::string::npos) version = line;
      cuda = cuda || line.find("with CUDA") != std::string::npos;
    });
  } catch (const Error& error) {
    return {"COLMAP", "not found: " + error.what_failed(),
            needed + "; install the package `colmap`"};
  }
  return {"COLMAP", version.empty() ? "'" + program + "' is not COLMAP" : version,
          needed + (cuda ? "; finds and matches features on the GPU" : "")};
}

Finding FindDevice() {
  const DeviceStatus status = ReadDeviceStatus();
  if (!status.found) return {"GPU", status.name, "everything runs on the CPU"};
  return {"GPU",
          Format("%s, sm_%d, %.1f GB free of %.1f GB", status.name.c_str(),
                 status.compute_capability, static_cast<double>(status.free_bytes) / (1u << 30),
                 static_cast<double>(status.total_bytes) / (1u << 30)),
          "runs fits, restyling and frames; the CPU runs the rest"};
}

}  // namespace

void RunDoctor(const Command& command, const Arguments& arguments, Console* console) {
  ProgramOptions program;
  OptionSet options;
  options.Add("Program", &program);
  if (!Prepare(command, arguments, {.least_words = 0, .most_words = 0}, &options)) return;

  const auto gigabytes = [](uint64_t bytes) {
    return Format("%.1f GB", static_cast<double>(bytes) / (1u << 30));
  };
  const MemoryStatus memory = ReadMemoryStatus();
  const std::string scratch = std::filesystem::temp_directory_path().string();
  std::vector<Finding> findings = {
      {"regrade", REGRADE_VERSION, ""},
      FindDevice(),
      {"threads",
       Concat(omp_get_max_threads(), " of ", ::sysconf(_SC_NPROCESSORS_ONLN), " cores"),
       "set with --threads"},
      {"memory", gigabytes(memory.available) + " free of " + gigabytes(memory.total),
       "limit with --max-memory"},
      {"fast path", FastRays().name, "instruction set of rendering and fitting"},
      FindColmap("colmap"),
  };
  for (const Library& library : PictureLibraries())
    findings.push_back({library.name, library.version, library.purpose});
  findings.push_back(
      {"libcurl", FetchLibrary(), "fetches networks that are named, after a yes"});
  console->Event("doctor", JsonValue::Object());
  for (const Finding& finding : findings) {
    if (program.json) {
      console->Event("finding", JsonValue::Object{{"name", finding.name},
                                                  {"value", finding.value},
                                                  {"meaning", finding.meaning}});
      continue;
    }
    std::printf("%-10s %s%s%s\n", finding.name.c_str(), Printable(finding.value).c_str(),
                finding.meaning.empty() ? "" : "  - ", finding.meaning.c_str());
  }
}

}  // namespace regrade
