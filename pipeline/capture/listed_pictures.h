// Pictures that a camera file names: where they may be, and what they are called on disk.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "pipeline/capture/name_index.h"

namespace regrade {

class ListedPictures {
 public:
  // `folder`: that of the camera file, to which names are relative.
  explicit ListedPictures(const std::filesystem::path& folder);

  // The picture's place on disk, relative to the folder, where `name` may have another
  // separator, another ending or none; empty if there is no such regular file. `line`: where
  // the camera file has the name. Throws Error(kInput) for a name that leads out of the folder
  // and of the folders beside it: a camera file may come from anywhere, and must not choose
  // which of the user's pictures are read.
  std::string Find(const std::string& name, const std::string& line);

  // The picture whose name is nearest to one that was not found; empty if there is none.
  std::string Nearest(const std::string& name);

 private:
  // Relative to the folder, without "." and, but for a first one, without "..".
  std::string PlaceOf(const std::string& name, const std::string& line) const;
  // The place's folder as it is called on disk, where that differs in case.
  std::filesystem::path FolderOf(const std::filesystem::path& place) const;
  // The pictures in a folder.
  const NameIndex& In(const std::filesystem::path& folder);

  std::filesystem::path folder_;
  std::map<std::string, NameIndex> names_;  // by folder
};

}  // namespace regrade
