#include "kernels/process/private_folder.h"

#include <stdlib.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "kernels/base/error.h"

namespace regrade {

namespace fs = std::filesystem;

namespace {
constexpr std::string_view kPrefix = "regrade-", kRandom = "XXXXXX";
}

bool IsPrivateFolderName(std::string_view name) {
  return name.starts_with(kPrefix) && name.size() == kPrefix.size() + kRandom.size();
}

PrivateFolder::PrivateFolder(const std::string& parent) {
  std::error_code error;
  const fs::path in = parent.empty() ? fs::temp_directory_path(error) : fs::path(parent);
  if (!error) path_ = fs::absolute(in / Concat(kPrefix, kRandom), error).string();
  if (error)
    throw ResourceError("there is no temporary folder: " + error.message(), "TMPDIR",
                        "set it to a folder on a disk with space");
  if (::mkdtemp(path_.data()) == nullptr)
    throw ResourceError(std::string("cannot make a temporary folder: ") + std::strerror(errno),
                        path_, parent.empty() ? "set TMPDIR to a disk with space" : "");
}

PrivateFolder::~PrivateFolder() {
  std::error_code error;
  fs::remove_all(path_, error);
}

}  // namespace regrade
