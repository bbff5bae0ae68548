// Whether a process is alive, for tests of processes that end together.
#pragma once

#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

namespace regrade::testing {

// A zombie, which init has not yet collected, counts as dead.
inline bool IsAlive(int pid) {
  std::ifstream stat("/proc/" + std::to_string(pid) + "/stat");
  std::string number, name, state;
  return static_cast<bool>(stat >> number >> name >> state) && state != "Z" && state != "X";
}

inline void Moment() { std::this_thread::sleep_for(std::chrono::milliseconds(10)); }

// Waits up to five seconds.
inline bool Ends(int pid) {
  for (int i = 0; i < 500 && IsAlive(pid); ++i) Moment();
  return !IsAlive(pid);
}

// The number in a file that another process writes and renames; 0 after ten seconds without it.
inline int NumberIn(const std::filesystem::path& file) {
  int number = 0;
  for (int i = 0; i < 1000 && number == 0; ++i, Moment()) std::ifstream(file) >> number;
  return number;
}

}  // namespace regrade::testing
