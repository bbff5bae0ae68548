#include "pipeline/page/view_job.h"

#include <algorithm>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/process/child_process.h"
#include "pipeline/files/json_file.h"

namespace regrade {

ViewJob::~ViewJob() { Cancel(); }

bool ViewJob::Running() const {
  const std::lock_guard lock(mutex_);
  return status_.state == "running";
}

JobStatus ViewJob::Status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

void ViewJob::Cancel() {
  const std::lock_guard lock(mutex_);
  cancelled_ = true;
}

int ViewJob::Start(const std::string& kind, const std::vector<std::string>& arguments,
                   std::function<void()> finish) {
  if (Running()) return 0;
  if (thread_.joinable()) thread_.join();
  const std::lock_guard lock(mutex_);  // the thread waits for it where it reads the status
  cancelled_ = false;
  thread_ =
      std::jthread([this, arguments, finish = std::move(finish)] { Work(arguments, finish); });
  const int number = status_.number + 1;
  status_ = {};
  status_.number = number;
  status_.kind = kind;
  status_.state = "running";
  return number;
}

void ViewJob::Take(const std::string& line) {
  if (!line.starts_with('{')) return;
  JsonValue event;
  try {
    event = ParseJson(line, "event");
  } catch (const Error&) {
    return;  // cut
  }
  const JsonValue* const name = event.Find("event");
  if (name == nullptr || !name->IsString()) return;
  const std::string& kind = name->AsString();
  const auto text = [&event](const char* member) {
    const JsonValue* const value = event.Find(member);
    return value != nullptr && value->IsString() ? value->AsString() : std::string();
  };
  const auto number = [&event](const char* member) {
    const JsonValue* const value = event.Find(member);
    return value != nullptr && value->IsNumber() ? value->AsDouble() : 0.0;
  };
  const std::lock_guard lock(mutex_);
  if (kind == "error") status_.error = text("text");
  if (kind == "stage_begin") status_.stage = text("stage"), status_.part = 0;
  if (kind != "progress") return;
  status_.note = text("note");
  status_.part =
      number("total") > 0 ? std::clamp(number("done") / number("total"), 0.0, 1.0) : 0;
}

void ViewJob::Work(const std::vector<std::string>& arguments,
                   const std::function<void()>& finish) {
  const auto cancelled = [this] {
    const std::lock_guard lock(mutex_);
    return cancelled_;
  };
  std::string state = "failed", error;
  try {
    ChildOptions child;
    child.argv = {"/proc/self/exe"};
    child.argv.insert(child.argv.end(), arguments.begin(), arguments.end());
    child.argv.emplace_back("--json");
    const ChildResult result = RunChild(
        child, [this](const std::string& line) { Take(line); },
        [&cancelled] { return !cancelled(); });
    if (cancelled()) {
      state = "cancelled";
    } else if (result.Succeeded()) {
      finish();
      state = "done";
    } else {
      error = result.Describe();
    }
  } catch (const std::exception& failure) {
    error = failure.what();
  } catch (...) {
    error = "an unknown error";
  }
  const std::lock_guard lock(mutex_);
  status_.state = state;
  if (state == "failed" && status_.error.empty()) status_.error = error;
  if (state != "failed") status_.error.clear();
}

}  // namespace regrade
