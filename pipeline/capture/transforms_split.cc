#include "pipeline/capture/transforms_split.h"

#include "pipeline/capture/name_index.h"

namespace regrade {
namespace {

// Nothing for a list that is missing or empty.
std::optional<std::set<std::string>> FilesIn(
    const std::string& path, const JsonValue& top, const char* key,
    const std::map<std::string, std::string>& file_by_place) {
  const JsonValue* names = top.Find(key);
  if (names == nullptr || names->IsNull()) return std::nullopt;
  if (!names->IsArray())
    throw InputError(std::string(key) + " is not a list", PlaceIn(path, *names));
  std::set<std::string> files;
  for (const JsonValue& name : names->AsArray()) {
    const auto found = file_by_place.find(name.IsString() ? WithSlashes(name.AsString()) : "");
    if (found == file_by_place.end())
      throw InputError(
          std::string(key) + " has " + DumpJson(name, -1) + ", which no frame is of",
          PlaceIn(path, name), "write the name as the frame's file_path has it");
    if (!found->second.empty()) files.insert(found->second);
  }
  if (files.empty()) return std::nullopt;
  return files;
}

}  // namespace

bool TransformsSplit::IsLeft(const std::string& file) const {
  if (test.contains(file)) return false;
  return train ? !train->contains(file) : validation.contains(file);
}

TransformsSplit ReadTransformsSplit(const std::string& path, const JsonValue& top,
                                    const std::map<std::string, std::string>& file_of) {
  std::map<std::string, std::string> by_place;
  for (const auto& [name, file] : file_of) by_place[WithSlashes(name)] = file;
  TransformsSplit split;
  split.train = FilesIn(path, top, "train_filenames", by_place);
  const auto test = FilesIn(path, top, "test_filenames", by_place);
  split.validation =
      FilesIn(path, top, "val_filenames", by_place).value_or(std::set<std::string>());
  split.test = test.value_or(split.validation);
  if (!split.train) return split;
  for (const std::string& file : *split.train)
    if (test && test->contains(file))
      throw InputError("\"" + file + "\" is for training and for tests",
                       PlaceIn(path, *top.Find("test_filenames")),
                       "list it in one of train_filenames and test_filenames");
    else
      split.test.erase(file);  // for validation alone
  return split;
}

}  // namespace regrade
