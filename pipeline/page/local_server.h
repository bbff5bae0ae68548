// A server for one person's browser on this machine: it listens on 127.0.0.1 and nothing else,
// holds a bounded number of connections, and answers each as request_reader.h says.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "pipeline/page/request_reader.h"

namespace regrade {

inline constexpr int kMostConnections = 16;
inline constexpr int kHeaderSeconds = 10, kBodySeconds = 60;

// 256 random bits of the system, in hexadecimal digits. Throws Error(kResources).
std::string MakeToken();

class LocalServer {
 public:
  // Listens on a free port. Throws Error(kResources).
  LocalServer(std::vector<Route> routes, std::string token);
  ~LocalServer();
  LocalServer(const LocalServer&) = delete;
  LocalServer& operator=(const LocalServer&) = delete;

  int port() const;
  // http://127.0.0.1:PORT/#TOKEN
  std::string Address() const;
  // Answers requests on this thread while `keep_going`, which is asked ten times a second. What
  // `keep_going` throws ends it; no other exception does: each ends its connection.
  void Run(const std::function<bool()>& keep_going);

 private:
  struct State;
  State* state_;
};

}  // namespace regrade
