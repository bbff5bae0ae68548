// Record of a finished stage: inputs, outputs with their hashes, duration and metrics.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/files/json_file.h"

namespace regrade {

struct StageOutput {
  std::string path;  // relative to the output folder
  int64_t bytes = 0;
  std::string hash;
};

struct StageRecord {
  std::string version;                // of the program
  JsonValue inputs;                   // object: options and hashes of the inputs
  std::vector<StageOutput> outputs;   // sorted by path
  double seconds = 0;                 // wall clock
  std::optional<double> cpu_seconds;  // of all threads and programs started; not in old records
  JsonValue metrics;                  // object, see metric.h; goes into the report

  // One hash of all outputs: an input of the following stages.
  std::string OutputHash() const;
};

// Content hash of a regular file, read in pieces. Throws Error(kInput).
std::string HashFile(const std::string& path);

// {name: hash} of the usable files of a folder. Errors as ListFolder.
JsonValue HashFolder(const std::string& folder);

// Hashes files, and all regular files in folders, given relative to `root`; our temporaries are
// left out. Throws Error(kInput) if one is missing.
std::vector<StageOutput> DescribeOutputs(const std::string& root,
                                         const std::vector<std::string>& paths);

// One sentence for each difference: "fit-rays: was 4096, now 8192"; of many in one object the
// first few are named and the others counted.
std::vector<std::string> Differences(const JsonValue& was, const JsonValue& now);

// One sentence for each output that is missing or changed.
std::vector<std::string> ChangedOutputs(const std::string& root, const StageRecord& record);

JsonValue ToJson(const StageRecord& record);
// Throws Error(kInput) with the number of an older schema.
void CheckRecordSchema(const JsonValue& value, const std::string& where);
// Throws Error(kInput): damaged, or of an older or newer schema than this program's.
StageRecord StageRecordFromJson(const JsonValue& value, const std::string& where);

}  // namespace regrade
