#include "pipeline/files/own_files.h"

#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/process/private_folder.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

void Refuse(const std::string& path, fs::file_type type, const std::error_code& error) {
  const char* what = nullptr;
  switch (type) {
    case fs::file_type::not_found:
    case fs::file_type::regular:
    case fs::file_type::directory:
      return;
    case fs::file_type::symlink:
      what = "is a link: files of a run are not looked for elsewhere";
      break;
    case fs::file_type::fifo:
      what = "is a named pipe, not a file";
      break;
    case fs::file_type::socket:
      what = "is a socket, not a file";
      break;
    case fs::file_type::none:
      throw ResourceError("cannot look at it: " + error.message(), path);
    default:
      what = "is a device, not a file";
  }
  throw InputError(what, path, "remove it, or put the file or folder itself in its place");
}

}  // namespace

void RefuseForeign(const std::string& path) {
  std::error_code error;
  const fs::file_type type = fs::symlink_status(path, error).type();
  Refuse(path, type, error);
}

// A folder that is gone meanwhile was another process's temporary.
void RefuseForeignBelow(const std::string& path) {
  RefuseForeign(path);
  std::error_code error;
  if (!fs::is_directory(fs::symlink_status(path, error))) return;
  for (fs::directory_iterator it(path, error), end; !error && it != end; it.increment(error)) {
    std::error_code of_entry;
    const fs::file_type type = it->symlink_status(of_entry).type();
    const std::string entry = it->path().string();
    Refuse(entry, type, of_entry);
    if (type == fs::file_type::directory &&
        !IsPrivateFolderName(it->path().filename().string()))
      RefuseForeignBelow(entry);
  }
  if (error && error != std::errc::no_such_file_or_directory)
    throw ResourceError("cannot list the folder: " + error.message(), path);
}

}  // namespace regrade
