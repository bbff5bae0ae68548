#include "pipeline/workspace/shared_work.h"

#include <filesystem>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/base/hash.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/text.h"
#include "pipeline/workspace/folder_lock.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr char kInputs[] = "inputs.json";

}  // namespace

SharedWork::SharedWork(std::string root, JsonValue inputs)
    : root_(std::move(root)),
      path_(root_ + "/" + HashText(HashOf(DumpJson(inputs, -1)))),
      inputs_(std::move(inputs)) {}

void SharedWork::Begin() const {
  MakeFolder(path_);
  WriteBesideOthers(Path(kInputs), inputs_);
}

std::string SharedWork::OtherSettings() const {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(root_, error))
    if (entry.path() != path_ && fs::exists(entry.path() / kInputs))
      return "there is work of other settings: " +
             Join(Differences(ReadJsonFile((entry.path() / kInputs).string()), inputs_), "; ");
  return "";
}

// Under another name first: what is half removed is no part.
void SharedWork::Drop() const {
  const std::string gone = OwnTemporary(path_);
  std::error_code error;
  fs::rename(path_, gone, error);
  fs::remove_all(gone, error);
  fs::remove(root_, error);
}

void WriteBesideOthers(const std::string& path, const JsonValue& value) {
  const std::string made = OwnTemporary(path);
  WriteJsonFile(made, value);
  RenameDurably(made, path);
}

}  // namespace regrade
