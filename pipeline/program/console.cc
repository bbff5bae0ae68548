#include "pipeline/program/console.h"

#include <spdlog/logger.h>
#include <spdlog/sinks/basic_file_sink.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "pipeline/program/interrupt.h"

namespace regrade {
namespace {

using Clock = std::chrono::steady_clock;

double Seconds(Clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

// Bytes of the UTF-8 character at `at`, or 0 if there is none or it controls the terminal.
size_t PrintableBytes(const std::string& text, size_t at) {
  const auto byte = [&](size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned lead = byte(at);
  if (lead < 0x80) return lead >= 0x20 && lead != 0x7f ? 1 : 0;
  const size_t size = lead >= 0xf0 && lead < 0xf5   ? 4
                      : lead >= 0xe0 && lead < 0xf0 ? 3
                      : lead >= 0xc2 && lead < 0xe0 ? 2
                                                    : 0;
  if (size == 0 || at + size > text.size()) return 0;
  for (size_t i = 1; i < size; ++i)
    if ((byte(at + i) & 0xc0) != 0x80) return 0;
  const unsigned second = byte(at + 1);
  const bool overlong = (lead == 0xe0 && second < 0xa0) || (lead == 0xf0 && second < 0x90);
  const bool out_of_range =
      (lead == 0xed && second >= 0xa0) || (lead == 0xf4 && second >= 0x90);
  const bool control = lead == 0xc2 && second < 0xa0;  // U+0080 to U+009F
  return overlong || out_of_range || control ? 0 : size;
}

// A closed stream is no reason to stop working: what cannot be printed is dropped.
void Put(std::FILE* stream, const std::string& text) {
  std::fwrite(text.data(), 1, text.size(), stream);
  std::fflush(stream);
  std::clearerr(stream);
}

}  // namespace

std::string Printable(const std::string& text) {
  std::string result;
  for (size_t at = 0; at < text.size();) {
    const size_t size = PrintableBytes(text, at);
    if (size > 0) {
      result.append(text, at, size);
      at += size;
      continue;
    }
    char escaped[8];
    std::snprintf(escaped, sizeof escaped, "\\x%02x", static_cast<unsigned char>(text[at]));
    result += escaped;
    ++at;
  }
  return result;
}

std::string DurationText(double seconds) {
  const int64_t whole = static_cast<int64_t>(std::lround(std::min(seconds, 3.6e8)));
  char text[64];
  if (whole >= 3600)
    std::snprintf(text, sizeof text, "%lld h %02lld min", static_cast<long long>(whole / 3600),
                  static_cast<long long>(whole / 60 % 60));
  else if (whole >= 60)
    std::snprintf(text, sizeof text, "%lld min %02lld s", static_cast<long long>(whole / 60),
                  static_cast<long long>(whole % 60));
  else
    std::snprintf(text, sizeof text, "%lld s", static_cast<long long>(whole));
  return text;
}

std::string MessageFor(const Error& error, const std::string& kept) {
  std::string text = error.where().empty() ? "" : error.where() + ": ";
  text += error.what_failed();
  if (!error.hint().empty()) text += ". To do: " + error.hint();
  if (!kept.empty()) text += ". Kept: " + kept;
  return Printable(text);
}

struct Console::Log {
  spdlog::logger logger;
};

Console::Console(bool json) : json_(json) {
  terminal_ = ::isatty(STDERR_FILENO) == 1;
  const char* no_color = std::getenv("NO_COLOR");
  const char* term = std::getenv("TERM");
  const bool dumb = term == nullptr || std::string(term) == "dumb";
  color_ = terminal_ && !dumb && (no_color == nullptr || *no_color == '\0');
  stage_begin_ = last_drawn_ = Clock::now();
}

Console::~Console() { Erase(); }

void Console::OpenLog(const std::string& path) {
  try {
    auto sink = std::make_shared<spdlog::sinks::basic_file_sink_mt>(path);
    sink->set_pattern("%Y-%m-%dT%H:%M:%S%z %l %v");
    log_ = std::make_unique<Log>(Log{spdlog::logger("regrade", sink)});
    log_->logger.flush_on(spdlog::level::info);
    log_->logger.set_error_handler([](const std::string&) {});  // a full disk is said elsewhere
  } catch (const spdlog::spdlog_ex& error) {
    log_.reset();
    Warn(std::string("no log is kept: ") + error.what());
  }
}

void Console::Say(const std::string& text, bool warning) {
  const std::string line = Printable(text);
  Erase();
  const char* begin = warning && color_ ? "\033[33m" : "";
  const char* end = warning && color_ ? "\033[0m" : "";
  if (!quiet_ || warning)
    Put(stderr, std::string(begin) + (warning ? "warning: " : "") + line + end + "\n");
  if (log_ != nullptr)
    log_->logger.log(warning ? spdlog::level::warn : spdlog::level::info,
                     spdlog::string_view_t(line.data(), line.size()));
}

void Console::Info(const std::string& text) {
  Say(text, false);
  if (!quiet_) Event("info", JsonValue::Object{{"text", text}});
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
  const std::string line = Printable(text);
  Put(stderr, std::string(color_ ? "\033[31m" : "") + "regrade: " + line +
                  (color_ ? "\033[0m" : "") + "\n");
  if (log_ != nullptr)
    log_->logger.log(spdlog::level::err, spdlog::string_view_t(line.data(), line.size()));
  Event("error", JsonValue::Object{{"text", text}, {"exit_code", static_cast<int>(code)}});
}

void Console::Event(const std::string& name, const JsonValue& members) {
  if (!json_) return;
  JsonValue line = JsonValue::Object{{"event", name}};
  for (const auto& [key, value] : members.AsObject()) line[key] = value;
  Put(stdout, DumpJson(line, -1) + "\n");
}

void Console::BeginStage(const std::string& stage) {
  stage_ = stage;
  eta_ = EtaEstimator();
  stage_begin_ = Clock::now();
  last_drawn_ = stage_begin_ - std::chrono::hours(1);
  Event("stage_begin", JsonValue::Object{{"stage", stage}});
}

double Console::StageSeconds() const { return Seconds(Clock::now() - stage_begin_); }

void Console::EndStage() {
  Erase();
  Event("stage_end", JsonValue::Object{{"stage", stage_}, {"seconds", StageSeconds()}});
}

ProgressFunction Console::StageProgress() {
  return [this](const Progress& progress) {
    Draw(progress);
    return StopRequested() ? LoopControl::kStop : LoopControl::kContinue;
  };
}

void Console::Draw(const Progress& progress) {
  if (quiet_) return;
  const Clock::time_point now = Clock::now();
  eta_.Add(Seconds(now - stage_begin_), progress.done, progress.total);
  const double interval = terminal_ ? 0.1 : json_ ? 1.0 : 10.0;  // seconds
  const bool last = progress.total > 0 && progress.done >= progress.total;
  if (Seconds(now - last_drawn_) < interval && !(last && terminal_)) return;
  last_drawn_ = now;

  const std::optional<double> left = eta_.Remaining();
  std::string line = stage_;
  if (progress.total > 0) {
    char percent[16];
    std::snprintf(percent, sizeof percent, "%3.0f %%",
                  100 * std::min(1.0, progress.done / progress.total));
    line += std::string("  ") + percent;
  }
  if (left) line += "  " + DurationText(*left) + " left";
  if (!progress.note.empty()) line += "  " + Printable(progress.note);
  if (terminal_) {
    winsize size = {};
    const bool known = ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0;
    const size_t width = known ? size.ws_col : 80;
    if (line.size() >= width) line.resize(width - 1);
    Put(stderr, "\r\033[K" + line);
    line_drawn_ = true;
  } else if (!json_) {
    Put(stderr, line + "\n");
  }
  Event("progress", JsonValue::Object{{"stage", stage_},
                                      {"done", progress.done},
                                      {"total", progress.total},
                                      {"seconds_left", left ? JsonValue(*left) : JsonValue()},
                                      {"note", progress.note}});
}

void Console::Erase() {
  if (line_drawn_) Put(stderr, "\r\033[K");
  line_drawn_ = false;
}

}  // namespace regrade
