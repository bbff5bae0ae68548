#include "pipeline/workspace/folder_size.h"

#include <filesystem>

#include "kernels/base/error.h"

namespace regrade {

uint64_t SizeOnDisk(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  if (fs::is_symlink(path, error)) return 0;
  if (fs::is_regular_file(path, error)) return fs::file_size(path, error);
  uint64_t sum = 0;
  for (fs::recursive_directory_iterator it(path, error), end; !error && it != end;
       it.increment(error))
    if (it->is_regular_file(error) && !it->is_symlink(error)) sum += it->file_size(error);
  return sum;
}

std::string SizeText(uint64_t bytes) {
  const double size = static_cast<double>(bytes);
  if (size < 1e6) return Format("%.0f kB", size * 1e-3);
  return size < 1e9 ? Format("%.0f MB", size * 1e-6) : Format("%.1f GB", size * 1e-9);
}

}  // namespace regrade
