// One piece of work at a time for the page: this program itself, started as a child, so that a
// damaged picture or a cancelled film ends with it.
#pragma once

#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace regrade {

struct JobStatus {
  int number = 0;              // 0: there has been none
  std::string kind;            // "style" or "film"
  std::string state = "idle";  // or "running", "done", "failed", "cancelled"
  std::string stage, note;     // of the running one
  double part = 0;             // of the stage, in [0, 1]
  std::string error;           // for a person
};

class ViewJob {
 public:
  ViewJob() = default;
  ~ViewJob();  // cancels
  ViewJob(const ViewJob&) = delete;
  ViewJob& operator=(const ViewJob&) = delete;

  // Starts `regrade ARGUMENTS --json`, then `finish`, on a thread of its own; 0 if a job runs.
  // An Error that `finish` throws is the job's.
  int Start(const std::string& kind, const std::vector<std::string>& arguments,
            std::function<void()> finish);
  bool Running() const;
  void Cancel();
  JobStatus Status() const;

 private:
  void Work(const std::vector<std::string>& arguments, const std::function<void()>& finish);
  void Take(const std::string& line);  // of the child

  mutable std::mutex mutex_;  // of what follows
  JobStatus status_;
  bool cancelled_ = false;
  std::jthread thread_;
};

}  // namespace regrade
