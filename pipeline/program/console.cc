#include "pipeline/program/console.h"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <iostream>

#include "kernels/base/clock.h"
#include "kernels/base/error.h"
#include "pipeline/files/file_problem.h"
#include "pipeline/program/interrupt.h"

namespace regrade {
namespace {

// A closed stream does not stop the work: the text is dropped.
void Put(std::FILE* stream, const std::string& text) {
  std::fwrite(text.data(), 1, text.size(), stream);
  std::fflush(stream);
  std::clearerr(stream);
}

}  // namespace

std::string MessageFor(const Error& error, const std::string& kept) {
  std::string text = error.where().empty() ? "" : Printable(error.where()) + ": ";
  text += error.what_failed();
  if (!error.hint().empty()) text += ". To do: " + error.hint();
  if (!kept.empty()) text += ". Kept: " + kept;
  return PrintableLines(text);
}

Console::Console(bool json) : json_(json) {
  terminal_ = ::isatty(STDERR_FILENO) == 1;
  const char* no_color = std::getenv("NO_COLOR");
  const char* term = std::getenv("TERM");
  const bool dumb = term == nullptr || std::string(term) == "dumb";
  color_ = terminal_ && !dumb && (no_color == nullptr || *no_color == '\0');
  begin_ = stage_begin_ = last_drawn_ = ClockSeconds();
}

Console::~Console() { Erase(); }

void Console::OpenLog(const std::string& path) {
  log_.Reset(OpenOwnFile(path, O_WRONLY | O_CREAT | O_APPEND));
  if (log_.get() < 0) Warn("no log is kept: cannot write " + path + ": " + FileProblem(errno));
}

void Console::Log(const char* level, const std::string& line) {
  if (log_.get() < 0) return;
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  char time[32] = "";
  if (::localtime_r(&now, &local) != nullptr)
    std::strftime(time, sizeof time, "%Y-%m-%dT%H:%M:%S%z", &local);
  const std::string text = Concat(time, ' ', level, ' ', line, '\n');
  // A full disk is reported by the writers of results.
  [[maybe_unused]] const ssize_t written = ::write(log_.get(), text.data(), text.size());
}

void Console::Say(const std::string& text, bool warning) {
  const std::string line = PrintableLines(text);
  Erase();
  const char* begin = warning && color_ ? "\033[33m" : "";
  const char* end = warning && color_ ? "\033[0m" : "";
  if (!quiet_ || warning)
    Put(stderr, std::string(begin) + (warning ? "warning: " : "") + line + end + "\n");
  Log(warning ? "warning" : "info", line);
}

void Console::Info(const std::string& text) {
  Say(text, false);
  if (!quiet_) Event("info", JsonValue::Object{{"text", text}});
}

void Console::Detail(const std::string& text) {
  if (verbose_) return Info(text);
  Log("info", Printable(text));
  if (!quiet_) Event("info", JsonValue::Object{{"text", text}});
}

void Console::DetailLines(const std::string& text) {
  if (verbose_) return Lines(text);
  for (const std::string& line : Split(text, '\n'))
    if (!line.empty()) Log("info", Printable(line));
}

void Console::Lines(const std::string& text) {
  size_t begin = 0;
  while (begin < text.size()) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    Say(text.substr(begin, end - begin), false);
    begin = end + 1;
  }
}

void Console::Warn(const std::string& text) {
  Say(text, true);
  Event("warning", JsonValue::Object{{"text", text}});
}

void Console::Fail(const Error& error) { Fail(MessageFor(error, kept_), error.code()); }

void Console::Fail(const std::string& text, ExitCode code) {
  Erase();
  const std::string line = PrintableLines(text);
  Put(stderr, std::string(color_ ? "\033[31m" : "") + "regrade: " + line +
                  (color_ ? "\033[0m" : "") + "\n");
  Log("error", line);
  Event("error", JsonValue::Object{{"text", text}, {"exit_code", static_cast<int>(code)}});
}

void Console::Event(const std::string& name, const JsonValue& members) {
  if (!json_) return;
  JsonValue line = JsonValue::Object{{"event", name}};
  for (const auto& [key, value] : members.AsObject()) line[key] = value;
  Put(stdout, DumpJson(line, -1) + "\n");
}

void Console::BeginStage(const std::string& stage, const std::string& title, double expected,
                         double later) {
  stage_ = stage;
  title_ = title.empty() ? stage : title;
  expected_.current = expected;
  expected_.later = later;
  eta_ = EtaEstimator();
  stage_begin_ = ClockSeconds();
  last_drawn_ = stage_begin_ - 3600;
  Event("stage_begin", JsonValue::Object{{"stage", stage}});
}

double Console::StageSeconds() const { return ClockSeconds() - stage_begin_; }

double Console::Seconds() const { return ClockSeconds() - begin_; }

void Console::EndStage() {
  Erase();
  if (expected_.current > 0) {
    expected_.finished += expected_.current;
    finished_s_ += StageSeconds();
  }
  expected_.current = expected_.later = 0;
  Event("stage_end", JsonValue::Object{{"stage", stage_}, {"seconds", StageSeconds()}});
}

ProgressFunction Console::StageProgress() {
  return [this](const Progress& progress) {
    Draw(progress);
    return StopRequested() ? LoopControl::kStop : LoopControl::kContinue;
  };
}

void Console::Draw(const Progress& progress) {
  if (quiet_ || (!terminal_ && !json_)) return;
  const double now = ClockSeconds();
  eta_.Add(now - stage_begin_, progress.done, progress.total);
  const double interval = terminal_ ? 0.1 : 1.0;  // seconds
  const bool last = progress.total > 0 && progress.done >= progress.total;
  if (now - last_drawn_ < interval && !(last && terminal_)) return;
  last_drawn_ = now;

  const std::optional<double> left = eta_.Remaining();
  if (terminal_) DrawLine(progress, left, now);
  Event("progress", JsonValue::Object{{"stage", stage_},
                                      {"done", progress.done},
                                      {"total", progress.total},
                                      {"seconds_left", left ? JsonValue(*left) : JsonValue()},
                                      {"note", progress.note}});
}

void Console::DrawLine(const Progress& progress, std::optional<double> left, double now) {
  std::string line = title_;
  if (progress.total > 0) {
    line += Format("  %3.0f %%", 100 * std::min(1.0, progress.done / progress.total));
  }
  if (left && expected_.later > 0 && progress.done > 0)
    line += "  about " +
            DurationText(LeftInAll(expected_, finished_s_, now - stage_begin_, *left)) +
            " left in all";
  else if (left)
    line += "  " + DurationText(*left) + " left";
  if (verbose_ && !progress.note.empty()) line += "  " + Printable(progress.note);
  winsize size = {};
  const bool known = ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0;
  const size_t width = known ? size.ws_col : 80;
  if (line.size() >= width) line.resize(width - 1);
  Put(stderr, "\r\033[K" + line);
  line_drawn_ = true;
}

void Console::Erase() {
  if (line_drawn_) Put(stderr, "\r\033[K");
  line_drawn_ = false;
}

bool CanAsk() { return ::isatty(STDIN_FILENO) == 1 && ::isatty(STDERR_FILENO) == 1; }

bool AnsweredYes(const std::string& question) {
  std::cerr << question << " [y/N] " << std::flush;
  std::string answer;
  std::getline(std::cin, answer);
  return answer == "y" || answer == "Y" || answer == "yes";
}

}  // namespace regrade
