#include "kernels/base/error.h"

#include <utility>

namespace regrade {
namespace {

std::string Joined(const std::string& what, const std::string& where, const std::string& hint) {
  std::string text = what;
  if (!where.empty()) text = where + ": " + text;
  if (!hint.empty()) text += " (" + hint + ")";
  return text;
}

}  // namespace

Error::Error(ExitCode code, std::string what, std::string where, std::string hint)
    : std::runtime_error(Joined(what, where, hint)),
      code_(code),
      what_(std::move(what)),
      where_(std::move(where)),
      hint_(std::move(hint)) {}

void FailCheck(const char* file, int line, const std::string& message) {
  std::ostringstream text;
  text << file << ":" << line << ": check failed: " << message;
  throw CheckFailure(text.str());
}

}  // namespace regrade
