// Runs the built program on a synthetic capture so small that a whole run takes seconds.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "pipeline/capture/synth_capture.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace regrade::testing {

// `regrade synth`, without a start of the program.
inline void WriteCapture(const std::string& folder, int views, const std::string& size) {
  SynthOptions options;
  options.views = views;
  options.size = size;
  WriteSyntheticCapture(folder, options, {});
}

// Options for the smallest possible fit, style and film: three frames, at which it is measured,
// too. Without a field none is fitted: of splats that are given.
inline std::vector<std::string> TinyFlags(const std::string& field = "splats") {
  const std::string flags =
      "--photo-size 64 --style-steps 3 --film-seconds 0.125 --fps 24 --film-size 64 --threads "
      "2 "
      "--tracks given ";
  if (field.empty()) return Words(flags);
  return Words(flags + "--field " + field +
               (field == "splats" ? " --splat-steps 60 --splats 2"
                                  : " --config {\"fit-resolutions\":[24],\"fit-steps\":[30]}"));
}

// Contents of all networks, fields, films and frames below a folder.
inline std::map<std::string, std::string> ResultsOf(const std::string& folder) {
  std::map<std::string, std::string> results;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const std::string kind = entry.path().extension().string();
    if (kind == ".npz" || kind == ".mp4" || kind == ".png")
      results[entry.path().lexically_relative(folder)] = ReadText(entry.path().string());
  }
  return results;
}

}  // namespace regrade::testing
