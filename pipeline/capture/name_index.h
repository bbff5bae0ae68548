// Names of pictures in camera files that were written on other systems, or before the pictures
// were saved in another format: which picture is meant.
#pragma once

#include <map>
#include <string>
#include <vector>

namespace regrade {

// Whether the name ends like that of a picture that is read, in any case: "a/b.JPG".
bool HasPictureName(const std::string& name);

// The name without such an ending.
std::string WithoutPictureEnding(const std::string& name);

// With '/' in place of '\', and without "." and "..".
std::string WithSlashes(std::string name);

class NameIndex {
 public:
  // `names`: paths with '/', relative to one folder.
  explicit NameIndex(const std::vector<std::string>& names);

  // The one that `wanted` means: the same; else the same with '/' for '\'; else in other case;
  // else with another ending or none. Empty if there is none, or several.
  std::string Find(const std::string& wanted) const;

  // The one with the fewest characters to change; empty if there are no names.
  std::string Nearest(const std::string& wanted) const;

 private:
  std::vector<std::string> names_;
  // By name, and less exactly: without the ending, and that in lower case. Empty: several.
  std::map<std::string, std::string> same_, other_ending_, other_case_;
};

}  // namespace regrade
