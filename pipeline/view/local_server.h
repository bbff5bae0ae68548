// An HTTP server for one person's browser on this machine: who may ask, what is asked for, and
// how much of it. The only file that speaks HTTP; local_server.cc has the library.
//
// It listens on 127.0.0.1 and nothing else. Every request but the first page's needs the token,
// which the browser keeps in the address's fragment and sends as a header: there is no cookie,
// so no other site's request carries it. The host must be this one (a name that was bound to
// 127.0.0.1 is another), and an origin, where a browser states one, this server's. Targets are
// compared with a list of routes as they are: no part of an address becomes a path.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace regrade {

struct HttpResponse {
  int status = 200;
  std::string body;
  std::string type = "application/json";
  std::string policy = "default-src 'none'";  // Content-Security-Policy
};

struct HttpRequest {
  std::string body;
  std::string name;  // header Regrade-Name: text of the browser's, not trusted
};

struct Route {
  std::string method, target;
  uint64_t most_bytes = 0;  // of a body
  bool open = false;        // answers without the token
  std::function<HttpResponse(const HttpRequest&)> answer;
};

inline constexpr uint32_t kMostHeaderBytes = 8192;
inline constexpr int kMostConnections = 16;
inline constexpr int kHeaderSeconds = 10, kBodySeconds = 60;

// {"error": text}
HttpResponse RefusedRequest(int status, const std::string& text);

// 256 random bits of the system, in hexadecimal digits. Throws Error(kResources).
std::string MakeToken();

// The answer to a whole request's bytes: parsed, checked and routed as the server does. For
// tests and fuzzing.
HttpResponse AnswerBytes(std::string_view bytes, const std::vector<Route>& routes,
                         const std::string& token, int port);

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
  // Answers requests on this thread while `keep_going`, which is asked ten times a second.
  void Run(const std::function<bool()>& keep_going);

 private:
  struct State;
  State* state_;
};

}  // namespace regrade
