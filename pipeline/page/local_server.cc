#include "pipeline/page/local_server.h"

#include <errno.h>
#include <sys/random.h>

#include <algorithm>
#include <array>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <chrono>
#include <cstring>
#include <memory>
#include <optional>
#include <utility>

#include "kernels/base/error.h"

namespace regrade {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using tcp = asio::ip::tcp;

constexpr int kDrainSeconds = 1;
constexpr size_t kMostDrained = 4 << 20;
// Connections that are refused because there are too many, at a time; further ones are closed.
constexpr int kMostRefused = 128;
constexpr std::chrono::milliseconds kTick(100);

}  // namespace

std::string MakeToken() {
  unsigned char bytes[32];
  if (::getrandom(bytes, sizeof bytes, 0) != sizeof bytes)
    throw ResourceError(std::strerror(errno), "the system's random numbers");
  std::string token;
  for (const unsigned char byte : bytes) token += Format("%02x", byte);
  return token;
}

struct LocalServer::State {
  std::vector<Route> routes;
  std::string token;
  asio::io_context context{1};
  // Run waits even while nothing is expected, for files to accept connections with.
  asio::executor_work_guard<asio::io_context::executor_type> work{context.get_executor()};
  tcp::acceptor acceptor{context};
  int port = 0, connections = 0;
  bool accepting = false;

  void Accept();
};

namespace {

class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(tcp::socket socket, const std::vector<Route>& routes, const std::string& token,
             int port, int* connections)
      : stream_(std::move(socket)), reader_(routes, token, port), connections_(connections) {
    ++*connections_;
  }
  ~Connection() { --*connections_; }

  void Start() {
    Guarded([this] {
      if (*connections_ > kMostConnections)
        return Write(RefusedRequest(503, "too many connections"));
      stream_.expires_after(std::chrono::seconds(kHeaderSeconds));
      Read();
    });
  }

 private:
  // Whatever is thrown is this connection's: it gets an answer, or ends.
  template <typename Work>
  void Guarded(const Work& work) {
    try {
      work();
    } catch (...) {
      try {
        if (!answered_) Write(RefusedRequest(500, "the request could not be read"));
      } catch (...) {  // without memory for an answer it ends
      }
    }
  }

  void Read() {
    stream_.async_read_some(
        asio::buffer(bytes_),
        [self = shared_from_this()](const beast::error_code& error, size_t size) {
          self->Guarded([&] { self->Take(error, size); });
        });
  }

  void Take(const beast::error_code& error, size_t size) {
    if (error == asio::error::eof && begun_)
      return Write(RefusedRequest(400, "the request has no end"));
    if (error) return;
    begun_ = true;
    const bool in_body = reader_.header_read();
    if (auto answer = reader_.Take({bytes_.data(), size})) return Write(std::move(*answer));
    if (!in_body && reader_.header_read())
      stream_.expires_after(std::chrono::seconds(kBodySeconds));
    Read();
  }

  void Write(HttpResponse response) {
    message_ = {};
    message_.result(static_cast<unsigned>(response.status));
    message_.version(11);
    message_.keep_alive(false);
    message_.set(http::field::content_type, response.type);
    message_.set("Content-Security-Policy", response.policy + "; frame-ancestors 'none'");
    message_.set("X-Frame-Options", "DENY");
    message_.set("X-Content-Type-Options", "nosniff");
    message_.set("Referrer-Policy", "no-referrer");
    message_.set("Cross-Origin-Resource-Policy", "same-origin");
    message_.set("Cross-Origin-Opener-Policy", "same-origin");
    message_.set(http::field::cache_control, "no-store");
    message_.body() = std::move(response.body);
    message_.prepare_payload();
    stream_.expires_after(std::chrono::seconds(kBodySeconds));
    answered_ = true;
    http::async_write(stream_, message_,
                      [self = shared_from_this()](const beast::error_code&, size_t) {
                        self->Guarded([&] { self->Written(); });
                      });
  }

  void Written() {
    beast::error_code ignored;
    stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    stream_.expires_after(std::chrono::seconds(kDrainSeconds));
    Drain(kMostDrained);
  }

  // What a refused client still sends is read for a moment and forgotten: closing on it would
  // take the answer from the client.
  void Drain(size_t left) {
    stream_.async_read_some(
        asio::buffer(bytes_.data(), std::min(left, bytes_.size())),
        [self = shared_from_this(), left](const beast::error_code& error, size_t size) {
          self->Guarded([&] {
            if (!error && size < left) self->Drain(left - size);
          });
        });
  }

  beast::tcp_stream stream_;
  RequestReader reader_;
  int* const connections_;
  std::array<char, 1 << 14> bytes_;
  bool begun_ = false, answered_ = false;
  http::response<http::string_body> message_;
};

}  // namespace

void LocalServer::State::Accept() {
  accepting = true;
  acceptor.async_accept([this](const beast::error_code& error, tcp::socket socket) {
    accepting = false;
    // Of files, for example, there are no more: some are closed soon, and Run goes on with it.
    if (error) return;
    if (connections < kMostConnections + kMostRefused)
      std::make_shared<Connection>(std::move(socket), routes, token, port, &connections)
          ->Start();
    Accept();
  });
}

LocalServer::LocalServer(std::vector<Route> routes, std::string token) : state_(new State) {
  state_->routes = std::move(routes);
  state_->token = std::move(token);
  const tcp::endpoint own(asio::ip::address_v4::loopback(), 0);
  beast::error_code error;
  state_->acceptor.open(own.protocol(), error);
  if (!error) state_->acceptor.bind(own, error);
  if (!error) state_->acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (error) {
    delete state_;
    throw ResourceError(error.message(), "127.0.0.1", "check the limits on open files");
  }
  state_->port = state_->acceptor.local_endpoint().port();
}

LocalServer::~LocalServer() { delete state_; }

int LocalServer::port() const { return state_->port; }

std::string LocalServer::Address() const {
  return Concat("http://127.0.0.1:", state_->port, "/#", state_->token);
}

void LocalServer::Run(const std::function<bool()>& keep_going) {
  while (keep_going()) {
    try {
      if (!state_->accepting) state_->Accept();
      state_->context.run_for(kTick);
    } catch (...) {  // of a connection, which has ended with it
    }
  }
}

}  // namespace regrade
