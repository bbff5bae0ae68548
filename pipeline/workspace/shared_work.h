// Work that several processes do part by part, at the same time and on any machines that share
// the folder.
#pragma once

#include <string>

#include "pipeline/files/json_file.h"

namespace regrade {

// ROOT/HASH/, HASH being that of the work's inputs: parts of other inputs are apart.
class SharedWork {
 public:
  SharedWork(std::string root, JsonValue inputs);

  const JsonValue& inputs() const { return inputs_; }
  const std::string& path() const { return path_; }
  std::string Path(const std::string& name) const { return path_ + "/" + name; }

  // Makes the folder, with its inputs. Throws Error(kResources).
  void Begin() const;
  // "there is work of other settings: splats: was 80, now 160"; empty where there is none.
  std::string OtherSettings() const;
  // Removes it all, and ROOT if nothing else is there.
  void Drop() const;

 private:
  std::string root_, path_;
  JsonValue inputs_;
};

// Several processes may write the same file at the same moment: the last one wins, whole.
void WriteBesideOthers(const std::string& path, const JsonValue& value);

}  // namespace regrade
