// The program's messages: text and a progress line on stderr, JSON lines on stdout with --json,
// and all messages in the output folder's log; and questions to the person at the terminal.
#pragma once

#include <optional>
#include <string>

#include "kernels/base/error.h"
#include "kernels/base/file_descriptor.h"
#include "kernels/base/progress.h"
#include "pipeline/files/json_file.h"
#include "pipeline/files/text.h"
#include "pipeline/program/eta_estimator.h"

namespace regrade {

// "WHERE: WHAT. HINT. Kept: KEPT." on one line, printable.
std::string MessageFor(const Error& error, const std::string& kept);

class Console {
 public:
  // `json`: events as lines of JSON on stdout. The progress line is drawn in place on a
  // terminal; elsewhere, in a file, there is none. Colour obeys NO_COLOR and TERM=dumb.
  explicit Console(bool json);
  ~Console();
  Console(const Console&) = delete;
  Console& operator=(const Console&) = delete;

  // From now on all messages also go to this file, appended with times. A log that cannot be
  // opened is a warning.
  void OpenLog(const std::string& path);

  void Info(const std::string& text);
  // Evidence of a decision, for the log, --json and --verbose.
  void Detail(const std::string& text);
  void DetailLines(const std::string& text);
  void SetVerbose(bool verbose) { verbose_ = verbose; }
  // A text of several lines, for example a table.
  void Lines(const std::string& text);
  void Warn(const std::string& text);
  void Fail(const Error& error);
  void Fail(const std::string& text, ExitCode code);
  // While quiet, messages and progress go to the log only; warnings and failures are printed.
  void SetQuiet(bool quiet) { quiet_ = quiet; }
  // What a failure from now on leaves intact; part of its message.
  void SetKept(const std::string& kept) { kept_ = kept; }
  // A line of JSON {"event": name, ...members} with --json, nothing without.
  void Event(const std::string& name, const JsonValue& members);

  // `title`: what a person reads in place of the stage's name; `expected`: seconds of this
  // stage and of all that follows it in this command, 0 where nobody knows.
  void BeginStage(const std::string& stage, const std::string& title = "", double expected = 0,
                  double later = 0);
  void EndStage();
  double StageSeconds() const;
  // Since this console was made, when the program began.
  double Seconds() const;
  // Draws the progress line, updates the estimate, and returns kStop after a signal.
  ProgressFunction StageProgress();

 private:
  void Log(const char* level, const std::string& line);
  void Say(const std::string& text, bool warning);
  void Draw(const Progress& progress);
  void DrawLine(const Progress& progress, std::optional<double> left, double now);
  void Erase();

  const bool json_;
  bool terminal_ = false;
  bool color_ = false;
  bool line_drawn_ = false;
  bool quiet_ = false;
  bool verbose_ = false;
  FileDescriptor log_;
  std::string stage_, title_, kept_;
  ExpectedTime expected_;
  double finished_s_ = 0;  // what finished stages took of which something was expected
  EtaEstimator eta_;
  double begin_, stage_begin_, last_drawn_;  // of ClockSeconds()
};

// Is there a terminal to ask on and to answer from?
bool CanAsk();

// "QUESTION [y/N]" on stderr; true for a yes. No answer is a no.
bool AnsweredYes(const std::string& question);

}  // namespace regrade
