#include "pipeline/view/local_server.h"

#include <errno.h>
#include <sys/random.h>

#include <algorithm>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <chrono>
#include <cstring>
#include <memory>
#include <optional>
#include <utility>

#include "kernels/base/error.h"
#include "pipeline/files/json_file.h"

namespace regrade {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using tcp = asio::ip::tcp;
using Parser = http::request_parser<http::string_body>;
using Message = http::request<http::string_body>;

constexpr int kDrainSeconds = 1;
constexpr size_t kMostDrained = 4 << 20;

struct Gate {
  const std::vector<Route>& routes;
  const std::string& token;
  int port;

  uint64_t MostBytes() const {
    uint64_t most = 0;
    for (const Route& route : routes) most = std::max(most, route.most_bytes);
    return most;
  }
};

std::string_view View(beast::string_view text) { return {text.data(), text.size()}; }

// The header's only value; nothing if it is missing or there are several.
std::optional<std::string_view> Only(const Message& message, http::field name) {
  const auto [begin, end] = message.equal_range(name);
  if (begin == end || std::next(begin) != end) return std::nullopt;
  return View(begin->value());
}

// In a time that does not depend on where they differ.
bool SameSecret(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  unsigned char difference = 0;
  for (size_t i = 0; i < a.size(); ++i) difference |= static_cast<unsigned char>(a[i] ^ b[i]);
  return difference == 0;
}

// The route of a request whose header is read, or why there is none. Nothing of the body has
// been read yet.
const Route* RouteOf(const Message& message, const Gate& gate, HttpResponse* refused) {
  const auto refuse = [&](int status, const char* text) {
    *refused = RefusedRequest(status, text);
    return nullptr;
  };
  const std::string port = std::to_string(gate.port);
  const auto host = Only(message, http::field::host);
  if (message.version() != 11) return refuse(505, "only HTTP/1.1 is spoken here");
  if (!host || (*host != "127.0.0.1:" + port && *host != "localhost:" + port))
    return refuse(421, "this is not the server of that host");
  if (message.count(http::field::origin) > 0 &&
      Only(message, http::field::origin) != "http://" + std::string(*host))
    return refuse(403, "another site may not ask here");
  const std::string_view method = View(message.method_string()),
                         target = View(message.target());
  const auto found = std::ranges::find_if(gate.routes, [&](const Route& route) {
    return route.method == method && route.target == target;
  });
  if (found == gate.routes.end() || !found->open) {
    const auto site = message.find("Sec-Fetch-Site");
    if (site != message.end() && site->value() != "same-origin")
      return refuse(403, "another site may not ask here");
    const auto given = Only(message, http::field::authorization);
    if (!given || !SameSecret(*given, "Bearer " + gate.token))
      return refuse(401, "open the address that regrade view printed");
  }
  if (found == gate.routes.end()) {
    const bool known = std::ranges::any_of(
        gate.routes, [&](const Route& route) { return route.target == target; });
    return known ? refuse(405, "this is not how to ask for it")
                 : refuse(404, "there is nothing of that name");
  }
  return &*found;
}

HttpResponse OfError(const beast::error_code& error) {
  if (error == http::error::header_limit) return RefusedRequest(431, "the header is too long");
  if (error == http::error::body_limit) return RefusedRequest(413, "the body is too long");
  return RefusedRequest(400, "this is no request");
}

bool IsTooLong(const Parser& parser, const Route& route) {
  const auto length = parser.content_length();
  return length && *length > route.most_bytes;
}

HttpResponse Answer(const Route& route, const Message& message) {
  const auto name = message.find("Regrade-Name");
  try {
    return route.answer({message.body(), name == message.end()
                                             ? std::string()
                                             : std::string(View(name->value()))});
  } catch (const Error& error) {
    return RefusedRequest(error.code() == ExitCode::kResources ? 507 : 422, error.what());
  }
}

void Limit(const Gate& gate, Parser* parser) {
  parser->header_limit(kMostHeaderBytes);
  parser->body_limit(gate.MostBytes());
}

}  // namespace

HttpResponse RefusedRequest(int status, const std::string& text) {
  HttpResponse response;
  response.status = status;
  response.body = DumpJson(JsonValue::Object{{"error", text}}, -1);
  return response;
}

std::string MakeToken() {
  unsigned char bytes[32];
  if (::getrandom(bytes, sizeof bytes, 0) != sizeof bytes)
    throw ResourceError(std::strerror(errno), "the system's random numbers");
  std::string token;
  for (const unsigned char byte : bytes) token += Format("%02x", byte);
  return token;
}

HttpResponse AnswerBytes(std::string_view bytes, const std::vector<Route>& routes,
                         const std::string& token, int port) {
  const Gate gate{routes, token, port};
  Parser parser;
  Limit(gate, &parser);
  beast::error_code error;
  size_t at = 0;
  const auto feed = [&] {
    const size_t used = parser.put(asio::buffer(bytes.data() + at, bytes.size() - at), error);
    at += used;
    return !error && used > 0;
  };
  while (!parser.is_header_done() && feed()) {
  }
  if (error == http::error::need_more) error = {};
  if (error) return OfError(error);
  if (!parser.is_header_done()) return RefusedRequest(408, "the request has no end");
  HttpResponse refused;
  const Route* const route = RouteOf(parser.get(), gate, &refused);
  if (route == nullptr) return refused;
  if (IsTooLong(parser, *route)) return RefusedRequest(413, "the body is too long");
  parser.body_limit(route->most_bytes);
  parser.eager(true);
  while (!parser.is_done() && feed()) {
  }
  if (error == http::error::need_more) error = {};
  if (error) return OfError(error);
  if (!parser.is_done()) return RefusedRequest(408, "the request has no end");
  return Answer(*route, parser.get());
}

struct LocalServer::State {
  std::vector<Route> routes;
  std::string token;
  asio::io_context context{1};
  tcp::acceptor acceptor{context};
  asio::steady_timer timer{context}, pause{context};
  int port = 0, connections = 0;

  Gate OwnGate() const { return {routes, token, port}; }
  void Accept();
};

namespace {

class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(tcp::socket socket, Gate gate, int* connections)
      : stream_(std::move(socket)), gate_(gate), connections_(connections) {
    ++*connections_;
    Limit(gate_, &parser_);
    parser_.eager(true);
  }
  ~Connection() { --*connections_; }

  void Start() {
    if (*connections_ > kMostConnections)
      return Write(RefusedRequest(503, "too many connections"));
    stream_.expires_after(std::chrono::seconds(kHeaderSeconds));
    http::async_read_header(stream_, buffer_, parser_,
                            [self = shared_from_this()](const beast::error_code& error,
                                                        size_t) { self->HeaderRead(error); });
  }

 private:
  void HeaderRead(const beast::error_code& error) {
    if (error == beast::error::timeout || error == http::error::end_of_stream) return;
    if (error) return Write(OfError(error));
    HttpResponse refused;
    route_ = RouteOf(parser_.get(), gate_, &refused);
    if (route_ == nullptr) return Write(refused);
    if (IsTooLong(parser_, *route_)) return Write(RefusedRequest(413, "the body is too long"));
    parser_.body_limit(route_->most_bytes);
    stream_.expires_after(std::chrono::seconds(kBodySeconds));
    http::async_read(
        stream_, buffer_, parser_,
        [self = shared_from_this()](const beast::error_code& failed, size_t) {
          if (failed == beast::error::timeout) return;
          self->Write(failed ? OfError(failed) : Answer(*self->route_, self->parser_.get()));
        });
  }

  void Write(HttpResponse response) {
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
    http::async_write(stream_, message_,
                      [self = shared_from_this()](const beast::error_code&, size_t) {
                        beast::error_code ignored;
                        self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
                        self->stream_.expires_after(std::chrono::seconds(kDrainSeconds));
                        self->Drain(kMostDrained);
                      });
  }

  // What a refused client still sends is read for a moment and forgotten: closing on it would
  // take the answer from the client.
  void Drain(size_t left) {
    buffer_.clear();
    stream_.async_read_some(
        buffer_.prepare(std::min<size_t>(left, 1 << 16)),
        [self = shared_from_this(), left](const beast::error_code& error, size_t bytes) {
          if (!error && bytes < left) self->Drain(left - bytes);
        });
  }

  beast::tcp_stream stream_;
  const Gate gate_;
  int* const connections_;
  beast::flat_buffer buffer_;
  Parser parser_;
  const Route* route_ = nullptr;
  http::response<http::string_body> message_;
};

}  // namespace

void LocalServer::State::Accept() {
  acceptor.async_accept([this](const beast::error_code& error, tcp::socket socket) {
    if (!acceptor.is_open()) return;
    if (!error)
      std::make_shared<Connection>(std::move(socket), OwnGate(), &connections)->Start();
    if (!error) return Accept();
    // Of files, for example, there are no more: some are closed soon.
    pause.expires_after(std::chrono::milliseconds(100));
    pause.async_wait([this](const beast::error_code&) { Accept(); });
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
  state_->Accept();
}

LocalServer::~LocalServer() { delete state_; }

int LocalServer::port() const { return state_->port; }

std::string LocalServer::Address() const {
  return Concat("http://127.0.0.1:", state_->port, "/#", state_->token);
}

void LocalServer::Run(const std::function<bool()>& keep_going) {
  const std::function<void(const beast::error_code&)> tick = [&](const beast::error_code&) {
    if (!keep_going()) return state_->context.stop();
    state_->timer.expires_after(std::chrono::milliseconds(100));
    state_->timer.async_wait(tick);
  };
  tick({});
  state_->context.run();
  state_->context.restart();
}

}  // namespace regrade
