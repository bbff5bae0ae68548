// The server of `regrade view`: each hostile request with its answer, and limits on what a
// client may hold.
#include "pipeline/page/local_server.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <memory>
#include <new>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "tests/support/expect_error.h"
#include "tests/support/hostile_requests.h"
#include "tests/support/loopback.h"

namespace regrade {
namespace {

using testing::BodyOf;
using testing::HostileRequests;
using testing::Loopback;
using testing::PlainRequest;
using testing::StatusOf;

// What was reached behind the server's checks.
struct Reached {
  std::atomic<int> times = 0;
  std::vector<Route> Routes() {
    const auto answer = [this](const HttpRequest& request) {
      ++times;
      HttpResponse response;
      response.body = "reached " + request.body;
      return response;
    };
    return {{"GET", "/", 0, true, answer},
            {"GET", "/page", 0, false, answer},
            {"POST", "/style", 1 << 20, false, answer}};
  }
};

// A server on a thread of its own.
class Running {
 public:
  explicit Running(Reached* reached) : Running(reached->Routes()) {}
  explicit Running(std::vector<Route> routes)
      : server_(std::move(routes), std::string(64, 'a')) {
    thread_ = std::thread([this] { server_.Run([this] { return !stop_; }); });
  }
  ~Running() {
    stop_ = true;
    thread_.join();
  }
  int port() const { return server_.port(); }
  std::string Ask(const std::string& bytes) const {
    const Loopback client(port());
    EXPECT_TRUE(client.connected());
    client.Send(bytes);
    return client.Receive();
  }

 private:
  LocalServer server_;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

TEST(LocalServer, F96_EveryHostileRequestHasItsAnswerAndReachesNothing) {
  Reached reached;
  const Running server(&reached);
  const std::string token(64, 'a');
  for (const auto& hostile : HostileRequests(server.port(), token)) {
    const std::string answer = server.Ask(hostile.bytes);
    EXPECT_EQ(StatusOf(answer), hostile.status)
        << hostile.name << ": " << answer.substr(0, 200);
    EXPECT_EQ(answer.find("Access-Control"), std::string::npos) << hostile.name;
    EXPECT_EQ(answer.find("Set-Cookie"), std::string::npos) << hostile.name;
    EXPECT_EQ(answer.find(token), std::string::npos) << hostile.name;
    // The same without a connection.
    EXPECT_EQ(AnswerBytes(hostile.bytes, reached.Routes(), token, server.port()).status,
              hostile.status)
        << hostile.name;
  }
  EXPECT_EQ(reached.times, 0);
}

TEST(LocalServer, F96_AnHonestRequestIsAnsweredAndMayNotBeFramedOrKept) {
  Reached reached;
  const Running server(&reached);
  const std::string token(64, 'a');
  const std::string page = server.Ask(PlainRequest("GET", "/page", server.port(), token));
  EXPECT_EQ(StatusOf(page), 200);
  EXPECT_EQ(BodyOf(page), "reached ");
  for (const char* line :
       {"Content-Security-Policy: default-src 'none'; frame-ancestors 'none'",
        "X-Content-Type-Options: nosniff", "Referrer-Policy: no-referrer",
        "Cache-Control: no-store", "Cross-Origin-Resource-Policy: same-origin"})
    EXPECT_NE(page.find(line), std::string::npos) << line;
  const std::string own =
      Concat("Origin: http://127.0.0.1:", server.port(), "\r\nSec-Fetch-Site: same-origin\r\n");
  const std::string posted =
      server.Ask(PlainRequest("POST", "/style", server.port(), token, own, "abc"));
  EXPECT_EQ(BodyOf(posted), "reached abc");
  EXPECT_EQ(StatusOf(server.Ask(PlainRequest("GET", "/", server.port(), ""))), 200);
  EXPECT_EQ(reached.times, 3);
}

TEST(LocalServer, F96_ListensOnThisMachineOnly) {
  Reached reached;
  const Running server(&reached);
  // Another address of the loopback network: a server on all addresses would take it.
  EXPECT_FALSE(Loopback(server.port(), "127.0.0.2").connected());
  EXPECT_TRUE(Loopback(server.port()).connected());
}

TEST(LocalServer, F96_ASlowHeaderIsCutOff) {
  Reached reached;
  const Running server(&reached);
  const Loopback slow(server.port());
  const auto begun = std::chrono::steady_clock::now();
  slow.Send("GET /page HTTP/1.1\r\nHost: ");
  EXPECT_EQ(slow.Receive(2 * kHeaderSeconds), "");
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begun;
  EXPECT_GT(took.count(), kHeaderSeconds - 1);
  EXPECT_LT(took.count(), kHeaderSeconds + 5);  // on a busy machine
}

TEST(LocalServer, F96_OfAHundredConnectionsAFewAreHeldAndItGoesOn) {
  Reached reached;
  const Running server(&reached);
  const std::string token(64, 'a');
  {
    std::vector<std::unique_ptr<Loopback>> all;
    for (int i = 0; i < 100; ++i) {
      all.push_back(std::make_unique<Loopback>(server.port()));
      all.back()->Send("GET /");
    }
    int refused = 0;
    for (size_t i = kMostConnections; i < all.size(); ++i)
      refused += StatusOf(all[i]->Receive(5)) == 503;
    EXPECT_EQ(refused, 100 - kMostConnections);
  }
  // Once they are gone there is room again.
  std::string page;
  for (int i = 0; i < 50 && StatusOf(page) != 200; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    page = server.Ask(PlainRequest("GET", "/page", server.port(), token));
  }
  EXPECT_EQ(StatusOf(page), 200);
  EXPECT_EQ(reached.times, 1);
}

// A route, the name of a kind of failure, that throws `thrown`.
template <typename T>
Route Throwing(const std::string& target, const T& thrown) {
  return {"GET", target, 0, true,
          [thrown](const HttpRequest&) -> HttpResponse { throw thrown; }};
}

TEST(LocalServer, WhatARouteThrowsIsAnAnswerAndTheServerGoesOn) {
  Reached reached;
  std::vector<Route> routes = reached.Routes();
  const std::vector<std::pair<Route, int>> failures = {
      {Throwing("/input", InputError("bad", "a.png")), 422},
      {Throwing("/resources", ResourceError("full", "a.png")), 507},
      {Throwing("/disk", std::filesystem::filesystem_error(
                             "write", std::make_error_code(std::errc::no_space_on_device))),
       507},
      {Throwing("/loop",
                std::filesystem::filesystem_error(
                    "status", std::make_error_code(std::errc::too_many_symbolic_link_levels))),
       500},
      {Throwing("/memory", std::bad_alloc()), 500},
      {Throwing("/length", std::length_error("too long")), 500},
      {Throwing("/number", 7), 500}};
  for (const auto& [route, status] : failures) routes.push_back(route);
  const Running server(routes);
  for (const auto& [route, status] : failures)
    EXPECT_EQ(StatusOf(server.Ask(PlainRequest("GET", route.target, server.port(), ""))),
              status)
        << route.target;
  EXPECT_EQ(StatusOf(server.Ask(PlainRequest("GET", "/", server.port(), ""))), 200);
}

TEST(LocalServer, ABodyEndsWhereItsLengthSays) {
  Reached reached;
  const Running server(&reached);
  const std::string token(64, 'a');
  const std::string first =
      PlainRequest("POST", "/style", server.port(), token, "Expect: 100-continue\r\n", "abc");
  const std::string answer =
      server.Ask(first + PlainRequest("GET", "/page", server.port(), token));
  EXPECT_EQ(BodyOf(answer), "reached abc");  // and nothing of a second request
  EXPECT_EQ(reached.times, 1);
}

TEST(LocalServer, WhatIsAskedToKeepGoingMayEndIt) {
  Reached reached;
  LocalServer server(reached.Routes(), std::string(64, 'a'));
  EXPECT_REGRADE_ERROR(server.Run([]() -> bool { throw ResourceError("it is gone"); }),
                       ExitCode::kResources, "it is gone");
}

TEST(LocalServer, GoesOnOnceThereAreFilesAgain) {
  Reached reached;
  LocalServer server(reached.Routes(), std::string(64, 'a'));
  const Loopback client(server.port());  // waits to be accepted
  client.Send(PlainRequest("GET", "/", server.port(), ""));
  rlimit before;
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  rlimit none = before;
  none.rlim_cur = 0;
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  int asked = 0;
  server.Run([&] {
    if (++asked == 3) {
      EXPECT_EQ(reached.times, 0);
      ::setrlimit(RLIMIT_NOFILE, &before);
    }
    return asked < 6;
  });
  EXPECT_EQ(StatusOf(client.Receive()), 200);
}

TEST(LocalServer, F96_TokensHave256BitsAndDiffer) {
  const std::string token = MakeToken();
  EXPECT_EQ(token.size(), 64u);
  EXPECT_EQ(token.find_first_not_of("0123456789abcdef"), std::string::npos);
  EXPECT_NE(token, MakeToken());
}

}  // namespace
}  // namespace regrade
