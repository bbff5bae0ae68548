// User-facing errors (Error, with an exit code and a remedy), their texts, and checks of
// internal invariants (CHECK).
#pragma once

#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

namespace regrade {

// The program's exit codes. Termination by signal n is 128 + n and not listed here.
enum class ExitCode {
  kDone = 0,
  kBug = 1,
  kUsage = 2,
  kInput = 3,
  kExternalProgram = 4,
  kResources = 5,
  kScene = 6,
  kFolderInUse = 7,
  kRequirement = 8,
};

// A recoverable user-facing error. `what` failed, `where` (file, photo, option; may be empty),
// and a `hint` with the remedy. Thrown from any layer, printed once by main, which exits with
// `code`.
class Error : public std::runtime_error {
 public:
  Error(ExitCode code, std::string what, std::string where = "", std::string hint = "");

  ExitCode code() const { return code_; }
  const std::string& what_failed() const { return what_; }
  const std::string& where() const { return where_; }
  const std::string& hint() const { return hint_; }

 private:
  ExitCode code_;
  std::string what_, where_, hint_;
};

// The errors of one exit code: throw InputError("no pixels", path).
template <ExitCode kCode>
struct CodedError : Error {
  explicit CodedError(std::string what, std::string where = "", std::string hint = "")
      : Error(kCode, std::move(what), std::move(where), std::move(hint)) {}
};
using UsageError = CodedError<ExitCode::kUsage>;
using InputError = CodedError<ExitCode::kInput>;
using ProgramError = CodedError<ExitCode::kExternalProgram>;
using ResourceError = CodedError<ExitCode::kResources>;
using SceneError = CodedError<ExitCode::kScene>;

// Texts, characters and integers in one text: Concat("frame ", 3) is "frame 3". Fractions do
// not compile: they need a number of digits.
template <typename... Parts>
std::string Concat(const Parts&... parts) {
  std::string text;
  const auto add = [&text](const auto& part) {
    using Part = std::decay_t<decltype(part)>;
    if constexpr (std::is_same_v<Part, char>)
      text += part;
    else if constexpr (std::is_integral_v<Part>)
      text += std::to_string(part);
    else
      text += std::string_view(part);
  };
  (add(parts), ...);
  return text;
}

// As printf prints it.
[[gnu::format(printf, 1, 2)]] std::string Format(const char* format, ...);

// The user cancelled the work (by a signal); the stage has saved its state if it can.
class Interrupted : public std::runtime_error {
 public:
  Interrupted() : std::runtime_error("interrupted") {}
};

// A violated internal invariant. main turns it into exit code 1.
class CheckFailure : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

[[noreturn]] void FailCheck(const char* file, int line, const std::string& message);

}  // namespace regrade

#define REGRADE_CHECK(condition)                                            \
  do {                                                                      \
    if (!(condition)) ::regrade::FailCheck(__FILE__, __LINE__, #condition); \
  } while (false)

#define REGRADE_CHECK_OP_(op, a, b)                                                      \
  do {                                                                                   \
    const auto& regrade_a_ = (a);                                                        \
    const auto& regrade_b_ = (b);                                                        \
    if (!(regrade_a_ op regrade_b_)) {                                                   \
      std::ostringstream regrade_s_;                                                     \
      regrade_s_ << #a " " #op " " #b " (" << regrade_a_ << " vs " << regrade_b_ << ")"; \
      ::regrade::FailCheck(__FILE__, __LINE__, regrade_s_.str());                        \
    }                                                                                    \
  } while (false)

#define REGRADE_CHECK_EQ(a, b) REGRADE_CHECK_OP_(==, a, b)
#define REGRADE_CHECK_GE(a, b) REGRADE_CHECK_OP_(>=, a, b)
#define REGRADE_CHECK_GT(a, b) REGRADE_CHECK_OP_(>, a, b)
#define REGRADE_CHECK_LE(a, b) REGRADE_CHECK_OP_(<=, a, b)
