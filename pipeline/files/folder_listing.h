// Lists what lies in a folder that somebody else filled, without being led astray by links,
// pipes or loops.
#pragma once

#include <string>
#include <vector>

namespace regrade {

struct ListedFile {
  std::string name;     // relative to the folder, with '/', bytes as they are
  std::string path;     // absolute, links resolved
  std::string problem;  // empty for a regular file that may be opened; otherwise why not
};

struct FolderListing {
  std::vector<ListedFile> files;  // in natural order of `name`
  int hidden = 0;                 // entries whose name begins with a dot: not entered
};

// All files below the folder. Links to files inside of it are files; links to folders are not
// entered (what they show is listed where it is, so a loop ends); links that lead out, broken
// links, named pipes, sockets, devices and unreadable folders are listed with their problem.
// Throws Error(kInput) if the folder is missing, not a folder or unreadable, Error(kResources)
// when its disk fails.
FolderListing ListFolder(const std::string& folder);

}  // namespace regrade
