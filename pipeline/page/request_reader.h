// One request to the server of `regrade view`, from its bytes to its answer: who may ask, what
// is asked for, and how much of it. The only file that speaks HTTP; request_reader.cc has the
// library.
//
// Every request but the first page's needs the token, which the browser keeps in the address's
// fragment and sends as a header: there is no cookie, so no other site's request carries it.
// The host must be this one (a name that was bound to 127.0.0.1 is another), and an origin,
// where a browser states one, this server's. Targets are compared with a list of routes as they
// are: no part of an address becomes a path. A body has its length in the header: there are no
// chunks, whose extensions and trailers have no limit.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
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

// {"error": text}
HttpResponse RefusedRequest(int status, const std::string& text);

// Holds at most kMostHeaderBytes and what one call brings, and the route's body.
class RequestReader {
 public:
  // They must outlive it.
  RequestReader(const std::vector<Route>& routes, const std::string& token, int port);
  ~RequestReader();
  RequestReader(const RequestReader&) = delete;
  RequestReader& operator=(const RequestReader&) = delete;

  // Takes the next bytes; gives the answer once it is known, and is not called after that. What
  // a route's function throws becomes an answer: 507 where the disk or another resource of the
  // machine is exhausted, 422 for other Errors, 500 for everything else.
  std::optional<HttpResponse> Take(std::string_view bytes);
  // Is a header accepted, so that the body is awaited?
  bool header_read() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// The answer to a whole request's bytes, taken as the server takes them. For tests and fuzzing.
HttpResponse AnswerBytes(std::string_view bytes, const std::vector<Route>& routes,
                         const std::string& token, int port);

}  // namespace regrade
