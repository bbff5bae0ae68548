// Versions of the libraries that read and write pictures and films.
#pragma once

#include <string>
#include <vector>

namespace regrade {

struct Library {
  std::string name, version, purpose;
};

std::vector<Library> PictureLibraries();

}  // namespace regrade
