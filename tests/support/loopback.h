// A connection to a server on this machine, byte by byte, for requests that no client sends.
#pragma once

#include <string>
#include <string_view>

namespace regrade::testing {

class Loopback {
 public:
  explicit Loopback(int port, const char* host = "127.0.0.1");
  ~Loopback();
  Loopback(const Loopback&) = delete;
  Loopback& operator=(const Loopback&) = delete;

  bool connected() const { return connected_; }
  bool Send(std::string_view bytes) const;
  // Until the server ends the connection, or after `seconds` of silence.
  std::string Receive(int seconds = 20) const;

 private:
  int fd_;
  bool connected_ = false;
};

// "HTTP/1.1 404 Not Found..." -> 404; 0 for no answer.
inline int StatusOf(const std::string& answer) {
  return answer.starts_with("HTTP/1.1 ") ? std::stoi(answer.substr(9, 3)) : 0;
}

inline std::string BodyOf(const std::string& answer) {
  const size_t at = answer.find("\r\n\r\n");
  return at == std::string::npos ? "" : answer.substr(at + 4);
}

}  // namespace regrade::testing
