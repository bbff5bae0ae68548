// Lists the files of an untrusted folder: links, pipes and loops are reported, not followed.
#pragma once

#include <set>
#include <string>
#include <vector>

namespace regrade {

struct ListedFile {
  std::string name;     // relative to the folder, with '/', raw bytes
  std::string path;     // absolute, links resolved
  std::string problem;  // empty for a regular file that may be opened; otherwise why not
};

struct FolderListing {
  std::vector<ListedFile> files;  // in natural order of `name`
  int hidden = 0;                 // entries whose name begins with a dot: not entered
  std::vector<std::string> runs;  // folders that hold our own results: not entered
};

// All files below the folder. Links to files inside it count as files. Links to folders are not
// entered: their target is listed at its own place, and loops end. Links that lead out, broken
// links, named pipes, sockets, devices and unreadable folders are listed with their problem.
// Throws Error(kInput) if the folder is missing, not a folder or unreadable, Error(kResources)
// when its disk fails.
FolderListing ListFolder(const std::string& folder);

// The files of these names, relative to the folder, wherever links lead; nothing else is looked
// at. What is no regular file has its problem.
FolderListing ListNames(const std::string& folder, const std::set<std::string>& names);

// Whether the folder is one that regrade writes its results to.
bool IsRunFolder(const std::string& folder);

}  // namespace regrade
