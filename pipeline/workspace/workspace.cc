#include "pipeline/workspace/workspace.h"

#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/base/hash.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/own_files.h"
#include "pipeline/files/text.h"
#include "pipeline/workspace/output_names.h"
#include "pipeline/workspace/style_folders.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr char kOwnFolder[] = "/.regrade";
constexpr uint64_t kMaxRecord = 256 << 20;
constexpr uint64_t kMaxCheckpoint = uint64_t{64} << 30;
constexpr std::string_view kCheckpointMark = "regrade checkpoint 1\n";
constexpr size_t kHashDigits = 16;
// Results at the top of an output folder.
constexpr const char* kResultNames[] = {"run.json",    "poses",    "field.npz", "styles",
                                        "network.npz", "views_2d", "frames",    "report.json"};

void RefuseForeignFolder(const std::string& folder) {
  if (Workspace::Exists(folder)) return;
  for (const char* name : kResultNames)
    if (fs::exists(fs::path(folder) / name))
      throw InputError(std::string("holds '") + name + "', which regrade did not write", folder,
                       "choose an empty or new folder with --out");
}

// Absolute, without a trailing slash.
std::string CleanPath(const std::string& folder) {
  std::error_code error;
  std::string path = fs::absolute(folder, error).lexically_normal().string();
  if (error)
    throw ResourceError("the working folder is gone: " + error.message(), folder,
                        "give an absolute path with --out");
  while (path.size() > 1 && path.back() == '/') path.pop_back();
  return path;
}

std::string StagePathIn(const std::string& folder, const std::string& stage) {
  return folder + kOwnFolder + "/stages/" + stage + ".json";
}

// The lock is held: no other run is writing them.
void RemoveTemporaries(const std::string& folder) {
  std::vector<fs::path> found;
  std::error_code error;
  const std::string suffix = kTemporarySuffix;
  for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end;
       it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name.size() > suffix.size() && name.ends_with(suffix)) found.push_back(it->path());
  }
  for (const fs::path& path : found) fs::remove_all(path, error);
}

}  // namespace

void MakeFolder(const std::string& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error || !fs::is_directory(folder))
    throw ResourceError(
        error ? "cannot make this folder: " + error.message() : "is not a folder", folder,
        "choose another folder with --out");
}

bool Workspace::Exists(const std::string& folder) {
  std::error_code error;
  return fs::is_directory(folder + kOwnFolder, error);
}

void Workspace::RefuseLinks(const std::string& folder) {
  RefuseForeign(folder + "/" + kStylesFolder);
  for (const char* name : kOwnNames) RefuseForeignBelow(folder + "/" + name);
}

void Workspace::CheckResults(const std::string& folder,
                             const std::vector<std::string>& stages) {
  RefuseLinks(folder);
  for (const std::string& stage : stages) {
    const std::string path = StagePathIn(folder, stage);
    if (!fs::exists(path)) continue;
    const std::vector<std::string> changed =
        ChangedOutputs(folder, StageRecordFromJson(ReadJsonFile(path, kMaxRecord), path));
    if (!changed.empty())
      throw InputError(
          Join(changed, "; "), folder,
          "run `regrade run` or `regrade stylize` again: it will redo stage " + stage);
  }
}

Workspace::Workspace(const std::string& folder) : folder_(CleanPath(folder)) {
  MakeFolder(folder_);
  RefuseForeignFolder(folder_);
  RefuseLinks(folder_);
  MakeFolder(folder_ + kOwnFolder);
  lock_.emplace(folder_ + kOwnFolder + "/lock", LockUse::kAlone);
  MakeFolder(Path(".regrade/stages"));
  MakeFolder(Path(".regrade/checkpoints"));
  RefuseOlderRecords();
  RemoveTemporaries(folder_);
}

Workspace::Workspace(const std::string& folder, BesideOthers) : folder_(CleanPath(folder)) {
  if (!Exists(folder_))
    throw InputError("no run has worked in this folder", folder, "name the folder of a run");
  RefuseLinks(folder_);
  MakeFolder(Path(".regrade/stages"));
  lock_.emplace(folder_ + kOwnFolder + "/lock", LockUse::kShared);
  RefuseOlderRecords();
}

std::string Workspace::NewPath(const std::string& relative) const {
  const std::string path = Path(relative);
  MakeFolder(fs::path(path).parent_path().string());
  return path;
}

void Workspace::RefuseOlderRecords() const {
  for (const std::string& stage : FinishedStages()) {
    JsonValue record;
    try {
      record = ReadJsonFile(StagePath(stage), kMaxRecord);
    } catch (const Error&) {  // a damaged record is reported by whoever needs it
      continue;
    }
    CheckRecordSchema(record, StagePath(stage));
  }
}

std::string Workspace::StagePath(const std::string& stage) const {
  return StagePathIn(folder_, stage);
}

std::string Workspace::CheckpointPath(const std::string& stage) const {
  return Path(".regrade/checkpoints/" + stage);
}

std::optional<StageRecord> Workspace::Find(const std::string& stage) const {
  const std::string path = StagePath(stage);
  if (!fs::exists(path)) return std::nullopt;
  return StageRecordFromJson(ReadJsonFile(path, kMaxRecord), path);
}

StageStatus Workspace::Status(const std::string& stage, const JsonValue& inputs) const {
  const std::optional<StageRecord> record = Find(stage);
  if (!record) return {StageState::kNeverDone, {}};
  std::vector<std::string> differences = Differences(record->inputs, inputs);
  if (record->version != REGRADE_VERSION)
    differences.push_back("made by regrade " + record->version + ", this is " REGRADE_VERSION);
  if (!differences.empty()) return {StageState::kInputsDiffer, std::move(differences)};
  std::vector<std::string> changed = ChangedOutputs(folder_, *record);
  if (!changed.empty()) return {StageState::kResultsDiffer, std::move(changed)};
  return {StageState::kDone, {}};
}

void Workspace::Record(const std::string& stage, const JsonValue& inputs,
                       const std::vector<std::string>& outputs, double seconds,
                       const JsonValue& metrics, std::optional<double> cpu_seconds) {
  StageRecord record;
  record.version = REGRADE_VERSION;
  record.inputs = inputs;
  record.outputs = DescribeOutputs(folder_, outputs);
  record.seconds = seconds;
  record.cpu_seconds = cpu_seconds;
  record.metrics = metrics;
  WriteJsonFile(StagePath(stage), ToJson(record));
  DropCheckpoint(stage);
}

void Workspace::Forget(const std::string& stage) {
  std::error_code error;
  fs::remove(StagePath(stage), error);
  DropCheckpoint(stage);
}

std::vector<std::string> Workspace::FinishedStages() const {
  std::vector<std::string> stages;
  for (const auto& entry : fs::directory_iterator(Path(".regrade/stages")))
    if (entry.path().extension() == ".json") stages.push_back(entry.path().stem().string());
  std::ranges::sort(stages);
  return stages;
}

// Layout: mark, hash of the inputs, hash of the content, the content.
void Workspace::SaveCheckpoint(const std::string& stage, const JsonValue& inputs,
                               std::vector<std::string_view> content) const {
  Hasher of_content;
  for (const std::string_view piece : content) of_content.Add(piece);
  const std::string head = std::string(kCheckpointMark) +
                           HashText(HashOf(DumpJson(inputs, -1))) +
                           HashText(of_content.Value());
  content.insert(content.begin(), head);
  WriteFileAtomically(CheckpointPath(stage), content);
}

namespace {

// Empty `of_inputs`: of any.
std::optional<std::string> ReadCheckpoint(const std::string& path,
                                          const std::string& of_inputs) {
  if (!fs::is_regular_file(path)) return std::nullopt;
  std::string blob = ReadWholeFile(path, kMaxCheckpoint);
  const size_t header = kCheckpointMark.size() + 2 * kHashDigits;
  if (blob.size() < header || !blob.starts_with(kCheckpointMark)) return std::nullopt;
  const std::string_view view = blob;
  const std::string_view inputs = view.substr(kCheckpointMark.size(), kHashDigits);
  const std::string_view of_bytes =
      view.substr(kCheckpointMark.size() + kHashDigits, kHashDigits);
  if ((!of_inputs.empty() && of_inputs != inputs) ||
      of_bytes != HashText(HashOf(view.substr(header))))
    return std::nullopt;
  blob.erase(0, header);
  return blob;
}

}  // namespace

std::optional<std::string> Workspace::LoadCheckpoint(const std::string& stage,
                                                     const JsonValue& inputs) const {
  return ReadCheckpoint(CheckpointPath(stage), HashText(HashOf(DumpJson(inputs, -1))));
}

std::optional<std::string> Workspace::PeekCheckpoint(const std::string& folder,
                                                     const std::string& stage) {
  return ReadCheckpoint(folder + "/.regrade/checkpoints/" + stage, "");
}

void Workspace::DropCheckpoint(const std::string& stage) const {
  std::error_code error;
  fs::remove(CheckpointPath(stage), error);
}

}  // namespace regrade
