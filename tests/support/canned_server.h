// A server on 127.0.0.1 that answers each path with given bytes, for tests of what fetches.
#pragma once

#include <atomic>
#include <map>
#include <string>
#include <thread>

namespace regrade::testing {

class CannedServer {
 public:
  // Path, such as "/a", to the whole answer; others get 404, and an empty answer never ends.
  explicit CannedServer(std::map<std::string, std::string> answers);
  ~CannedServer();
  CannedServer(const CannedServer&) = delete;
  CannedServer& operator=(const CannedServer&) = delete;

  int port() const { return port_; }
  std::string Address(const std::string& path) const;
  int requests() const { return requests_; }

 private:
  void Serve();

  std::map<std::string, std::string> answers_;
  int fd_ = -1, port_ = 0;
  std::atomic<bool> stop_ = false;
  std::atomic<int> requests_ = 0;
  std::thread thread_;
};

// A whole answer with a body.
std::string Answer200(const std::string& body);
std::string Redirect(const std::string& to);

}  // namespace regrade::testing
