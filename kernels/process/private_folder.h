// A folder for temporary files that nobody else can read or prepare.
#pragma once

#include <string>
#include <string_view>

namespace regrade {

// Whether a folder has the name of one: "regrade-" and six characters. A killed process leaves
// its own.
bool IsPrivateFolderName(std::string_view name);

// A new folder of mode 0700 and an unpredictable name, removed with all that is in it.
class PrivateFolder {
 public:
  // In `parent`; empty: the system's temporary folder. Throws Error(kResources).
  explicit PrivateFolder(const std::string& parent = "");
  ~PrivateFolder();
  PrivateFolder(const PrivateFolder&) = delete;
  PrivateFolder& operator=(const PrivateFolder&) = delete;

  const std::string& path() const { return path_; }
  std::string operator/(const char* name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

}  // namespace regrade
