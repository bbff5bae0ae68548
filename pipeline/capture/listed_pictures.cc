#include "pipeline/capture/listed_pictures.h"

#include <vector>

#include "kernels/base/error.h"
#include "pipeline/files/text.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

// Inside the folder, or in a folder beside it.
bool MayBeRead(const fs::path& relative) {
  auto part = relative.begin();
  if (relative.empty() || relative.is_absolute()) return false;
  if (*part != "..") return true;
  return ++part != relative.end() && *part != ".." && ++part != relative.end();
}

}  // namespace

ListedPictures::ListedPictures(const fs::path& folder) {
  std::error_code error;
  folder_ = fs::weakly_canonical(folder.empty() ? fs::path(".") : folder, error);
}

std::string ListedPictures::PlaceOf(const std::string& name, const std::string& line) const {
  fs::path path = (folder_ / name).lexically_normal();
  if (fs::path(name).is_absolute()) {  // its folder may have been reached through a link
    std::error_code error;
    const fs::path parent = fs::weakly_canonical(path.parent_path(), error);
    if (!error) path = parent / path.filename();
  }
  const fs::path relative = path.lexically_relative(folder_);
  if (!MayBeRead(relative))
    throw InputError(
        "\"" + name + "\" is neither in the folder of this file nor in one beside it", line,
        "such pictures are not read: copy or link them into " + folder_.string() +
            ", and name them relative to it");
  return relative.generic_string();
}

const NameIndex& ListedPictures::In(const fs::path& folder) {
  const auto found = names_.find(folder.generic_string());
  if (found != names_.end()) return found->second;
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator it(folder_ / folder, error), end; !error && it != end;
       it.increment(error))
    if (std::error_code none; it->is_regular_file(none) && HasPictureName(it->path().string()))
      names.push_back(it->path().filename().string());
  return names_.emplace(folder.generic_string(), names).first->second;
}

fs::path ListedPictures::FolderOf(const fs::path& place) const {
  fs::path folder;
  for (const fs::path& part : place.parent_path()) {
    std::error_code error;
    fs::path next = part;
    if (!fs::is_directory(folder_ / folder / part, error)) {
      std::vector<std::string> names;
      for (fs::directory_iterator it(folder_ / folder, error), end; !error && it != end;
           it.increment(error))
        if (std::error_code none;
            it->is_directory(none) &&
            LowerCase(it->path().filename().string()) == LowerCase(part.string()))
          names.push_back(it->path().filename().string());
      if (names.size() == 1) next = names[0];
    }
    folder /= next;
  }
  return folder;
}

std::string ListedPictures::Find(const std::string& name, const std::string& line) {
  std::error_code none;
  const std::string literal = PlaceOf(name, line);
  for (const char* ending : {"", ".png", ".jpg", ".jpeg"})
    if (fs::is_regular_file(folder_ / (literal + ending), none)) return literal + ending;
  const fs::path place = PlaceOf(WithSlashes(name), line);
  if (fs::is_regular_file(folder_ / place, none)) return place.generic_string();
  const fs::path folder = FolderOf(place);
  const std::string found = In(folder).Find(place.filename().string());
  return found.empty() ? "" : (folder / found).generic_string();
}

std::string ListedPictures::Nearest(const std::string& name) {
  const fs::path place = WithSlashes(name);
  std::vector<std::string> names;
  const auto add = [&](const fs::path& folder) {
    const std::string nearest = In(folder).Nearest(place.filename().string());
    if (!nearest.empty()) names.push_back((folder / nearest).generic_string());
  };
  std::error_code error;
  if (fs::is_directory(folder_ / place.parent_path(), error)) add(place.parent_path());
  if (names.empty()) {  // the folder has another name
    add("");
    for (fs::directory_iterator it(folder_, error), end; !error && it != end;
         it.increment(error))
      if (std::error_code none; it->is_directory(none)) add(it->path().filename());
  }
  return NameIndex(names).Nearest(place.generic_string());
}

}  // namespace regrade
