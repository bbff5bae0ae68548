// Fuzz target: requests to the server of `regrade view`.
#include "pipeline/page/local_server.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/mutate.h"
#include "tests/support/hostile_requests.h"

namespace regrade::testing {
namespace {

constexpr int kPort = 40123;

const std::string& Token() {
  static const std::string token(64, 'a');
  return token;
}

std::vector<std::string> RequestSeeds() {
  return {PlainRequest("GET", "/page", kPort, Token()), PlainRequest("GET", "/", kPort, ""),
          PlainRequest("POST", "/style", kPort, Token(), "Regrade-Name: a.png\r\n", "abc"),
          PlainRequest("POST", "/style", kPort, Token(), "Expect: 100-continue\r\n", "abc") +
              PlainRequest("GET", "/page", kPort, Token())};
}

// Whatever the bytes are, only those that hold the token reach what needs it, and no body is
// longer than its route allows.
bool ReadRequest(std::string_view bytes) {
  constexpr uint64_t kMost = 1000;
  bool reached = false, secret = false;
  const auto open = [&](const HttpRequest&) {
    reached = true;
    return HttpResponse();
  };
  const auto closed = [&](const HttpRequest& request) {
    FuzzRequire(request.body.size() <= kMost, "a body is within its limit");
    reached = secret = true;
    return HttpResponse();
  };
  const std::vector<Route> routes = {{"GET", "/", 0, true, open},
                                     {"GET", "/page", 0, false, closed},
                                     {"POST", "/style", kMost, false, closed}};
  const HttpResponse response = AnswerBytes(bytes, routes, Token(), kPort);
  FuzzRequire(response.status >= 200 && response.status < 600, "an answer has a status");
  FuzzRequire(reached == (response.status == 200), "what is refused reaches nothing");
  FuzzRequire(!secret || bytes.find(Token()) != std::string_view::npos, "the token is needed");
  return reached;
}

std::string Mutate(std::string bytes, FuzzRandom* random) {
  return MutateBytes(std::move(bytes), random);
}

}  // namespace

std::vector<FuzzTarget> RequestTargets() {
  return {{"request", RequestSeeds, ReadRequest, Mutate, 20000}};
}

}  // namespace regrade::testing
