#include "pipeline/files/file_problem.h"

#include <cerrno>
#include <cstring>

namespace regrade {

std::string FileProblem(int error) {
  if (error == ELOOP) return "it is a link, which is not followed";
  if (error == ENXIO) return "it is a named pipe or a device, not a file";
  return std::strerror(error);
}

std::string FileRemedy(int error, const std::string& otherwise) {
  if (error == ENOSPC || error == EDQUOT || error == EFBIG)
    return "free some space or raise the limit, then run the same command again";
  if (error == EMFILE || error == ENFILE || error == ENOMEM)
    return "raise the limit (ulimit -n, ulimit -v), then run the same command again";
  if (error == ELOOP || error == ENXIO) return "remove it, then run the same command again";
  return otherwise;
}

}  // namespace regrade
