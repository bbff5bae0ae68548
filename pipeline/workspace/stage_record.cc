#include "pipeline/workspace/stage_record.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/base/file_descriptor.h"
#include "kernels/base/hash.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/folder_listing.h"
#include "pipeline/files/own_files.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kSchema = 3;
constexpr size_t kNamedDifferences = 4;

std::string Shown(const JsonValue& value) {
  std::string text = value.IsString() ? value.AsString() : DumpJson(value, -1);
  if (text.size() > 60) text = text.substr(0, 57) + "...";
  return text.empty() ? "nothing" : text;
}

void AddDifferences(const std::string& path, const JsonValue& was, const JsonValue& now,
                    std::vector<std::string>* result) {
  if (!was.IsObject() || !now.IsObject()) {
    if (!(was == now))
      result->push_back((path.empty() ? "" : path + ": ") + "was " + Shown(was) + ", now " +
                        Shown(now));
    return;
  }
  std::vector<std::string> here;
  for (const auto& [key, value] : was.AsObject()) {
    const std::string name = path.empty() ? key : path + " " + key;
    if (const JsonValue* other = now.Find(key))
      AddDifferences(name, value, *other, &here);
    else
      here.push_back(name + " is gone");
  }
  for (const auto& [key, value] : now.AsObject())
    if (was.Find(key) == nullptr)
      here.push_back((path.empty() ? key : path + " " + key) + " is new");
  if (!path.empty() && here.size() > kNamedDifferences) {
    const size_t more = here.size() - kNamedDifferences;
    here.resize(kNamedDifferences);
    here.push_back(Concat("and ", more, " more differences of ", path));
  }
  result->insert(result->end(), here.begin(), here.end());
}

}  // namespace

std::string StageRecord::OutputHash() const {
  Hasher hasher;
  for (const StageOutput& output : outputs) hasher.Add(output.path + "\n" + output.hash + "\n");
  return HashText(hasher.Value());
}

std::string HashFile(const std::string& path) {
  const FileDescriptor fd(OpenToRead(path, nullptr));
  Hasher hasher;
  std::vector<char> piece(1 << 20);
  while (true) {
    const ssize_t n = ::read(fd.get(), piece.data(), piece.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) ThrowReadError(path);
    if (n == 0) break;
    hasher.Add(piece.data(), static_cast<size_t>(n));
  }
  return HashText(hasher.Value());
}

JsonValue HashFolder(const std::string& folder) {
  JsonValue hashes = JsonValue::Object();
  for (const ListedFile& file : ListFolder(folder).files)
    if (file.problem.empty()) hashes[file.name] = HashFile(file.path);
  return hashes;
}

std::vector<StageOutput> DescribeOutputs(const std::string& root,
                                         const std::vector<std::string>& paths) {
  std::vector<StageOutput> outputs;
  const auto add = [&](const fs::path& file) {
    if (file.string().ends_with(kTemporarySuffix)) return;
    outputs.push_back({file.lexically_relative(root).generic_string(),
                       static_cast<int64_t>(fs::file_size(file)), HashFile(file.string())});
  };
  for (const std::string& path : paths) {
    const fs::path full = fs::path(root) / path;
    RefuseForeign(full.string());
    if (fs::is_directory(full)) {
      for (const auto& entry : fs::recursive_directory_iterator(full))
        if (entry.is_regular_file() && !entry.is_symlink()) add(entry.path());
    } else if (fs::is_regular_file(full)) {
      add(full);
    } else {
      throw InputError("this result is missing", full.string());
    }
  }
  std::ranges::sort(outputs, {}, &StageOutput::path);
  return outputs;
}

std::vector<std::string> Differences(const JsonValue& was, const JsonValue& now) {
  std::vector<std::string> result;
  AddDifferences("", was, now, &result);
  return result;
}

std::vector<std::string> ChangedOutputs(const std::string& root, const StageRecord& record) {
  std::vector<std::string> changed;
  for (const StageOutput& output : record.outputs) {
    const fs::path full = fs::path(root) / output.path;
    std::error_code error;
    const fs::file_type type = fs::symlink_status(full, error).type();
    if (type != fs::file_type::regular) {
      changed.push_back(output.path +
                        (type == fs::file_type::symlink ? " is a link" : " is gone"));
      continue;
    }
    const auto bytes = fs::file_size(full, error);
    if (error || static_cast<int64_t>(bytes) != output.bytes ||
        HashFile(full.string()) != output.hash)
      changed.push_back(output.path + " has been changed");
  }
  return changed;
}

JsonValue ToJson(const StageRecord& record) {
  JsonValue::Array outputs;
  for (const StageOutput& output : record.outputs)
    outputs.push_back(JsonValue::Object{
        {"path", output.path}, {"bytes", output.bytes}, {"hash", output.hash}});
  JsonValue json = JsonValue::Object{{"schema", kSchema},
                                     {"regrade", record.version},
                                     {"inputs", record.inputs},
                                     {"outputs", std::move(outputs)},
                                     {"seconds", record.seconds}};
  if (record.cpu_seconds) json["cpu_seconds"] = *record.cpu_seconds;
  json["metrics"] = record.metrics;
  return json;
}

void CheckRecordSchema(const JsonValue& value, const std::string& where) {
  const JsonValue* schema = value.Find("schema");
  if (schema == nullptr || !schema->IsNumber() || schema->AsDouble() >= kSchema) return;
  throw InputError("made by an older regrade (schema " + DumpJson(*schema, -1) + ")", where,
                   "use another --out, or delete the output folder");
}

StageRecord StageRecordFromJson(const JsonValue& value, const std::string& where) {
  StageRecord record;
  try {
    record.version = value.At("regrade").AsString();
    const int64_t schema = value.At("schema").AsInt();
    if (schema > kSchema)
      throw InputError("written by regrade " + record.version + ", this is " REGRADE_VERSION,
                       where, "update regrade; nothing has been touched");
    CheckRecordSchema(value, where);
    record.inputs = value.At("inputs");
    for (const JsonValue& output : value.At("outputs").AsArray()) {
      // Paths out of the folder are refused.
      const fs::path path = output.At("path").AsString();
      if (path.is_absolute() || path.lexically_normal() != path ||
          path.string().ends_with("/") || *path.begin() == "..")
        throw InputError("a path that leads out of the folder");
      record.outputs.push_back(
          {path.string(), output.At("bytes").AsInt(), output.At("hash").AsString()});
    }
    record.seconds = value.At("seconds").AsDouble();
    if (const JsonValue* cpu = value.Find("cpu_seconds")) record.cpu_seconds = cpu->AsDouble();
    record.metrics = value.At("metrics");
  } catch (const Error& error) {
    if (!error.hint().empty()) throw;
    throw InputError(error.what_failed(), where,
                     "delete this file: its stage will be done again");
  }
  return record;
}

}  // namespace regrade
