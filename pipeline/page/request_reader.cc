#include "pipeline/page/request_reader.h"

#include <errno.h>

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/beast/core/error.hpp>
#include <boost/beast/http.hpp>
#include <new>
#include <system_error>
#include <utility>

#include "kernels/base/error.h"
#include "pipeline/files/json_file.h"

namespace regrade {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using Parser = http::request_parser<http::string_body>;
using Message = http::request<http::string_body>;

std::string_view AsStringView(beast::string_view text) { return {text.data(), text.size()}; }

// The header's only value; nothing if it is missing or there are several.
std::optional<std::string_view> Only(const Message& message, http::field name) {
  const auto [begin, end] = message.equal_range(name);
  if (begin == end || std::next(begin) != end) return std::nullopt;
  return AsStringView(begin->value());
}

// In a time that does not depend on where they differ.
bool SameSecret(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  unsigned char difference = 0;
  for (size_t i = 0; i < a.size(); ++i) difference |= static_cast<unsigned char>(a[i] ^ b[i]);
  return difference == 0;
}

HttpResponse OfError(const beast::error_code& error) {
  if (error == http::error::header_limit) return RefusedRequest(431, "the header is too long");
  if (error == http::error::body_limit) return RefusedRequest(413, "the body is too long");
  return RefusedRequest(400, "this is no request");
}

HttpResponse OfSystem(const std::error_code& code, const char* what) {
  const int why = code.value();
  return RefusedRequest(why == ENOSPC || why == EDQUOT || why == EFBIG ? 507 : 500, what);
}

HttpResponse Answer(const Route& route, const Message& message) {
  const auto name = message.find("Regrade-Name");
  try {
    return route.answer({message.body(), name == message.end()
                                             ? std::string()
                                             : std::string(AsStringView(name->value()))});
  } catch (const Error& error) {
    return RefusedRequest(error.code() == ExitCode::kResources ? 507 : 422, error.what());
  } catch (const std::system_error& error) {  // of files and folders, too
    return OfSystem(error.code(), error.what());
  } catch (const std::bad_alloc&) {
    return RefusedRequest(500, "out of memory");
  } catch (const std::exception& error) {
    return RefusedRequest(500, error.what());
  } catch (...) {
    return RefusedRequest(500, "an unknown error");
  }
}

}  // namespace

HttpResponse RefusedRequest(int status, const std::string& text) {
  HttpResponse response;
  response.status = status;
  response.body = DumpJson(JsonValue::Object{{"error", text}}, -1);
  return response;
}

struct RequestReader::State {
  const std::vector<Route>& routes;
  const std::string& token;
  const int port;
  Parser parser = {};
  std::string pending = {};      // bytes that the parser has not used yet
  const Route* route = nullptr;  // of an accepted header

  uint64_t MostBytes() const;
  // The route of a request whose header is read, or why there is none. Nothing of the body has
  // been read yet.
  const Route* RouteOf(HttpResponse* refused) const;
  // Gives the parser the pending bytes until `done`.
  template <typename Done>
  beast::error_code Parse(const Done& done);
};

uint64_t RequestReader::State::MostBytes() const {
  uint64_t most = 0;
  for (const Route& r : routes) most = std::max(most, r.most_bytes);
  return most;
}

const Route* RequestReader::State::RouteOf(HttpResponse* refused) const {
  const Message& message = parser.get();
  const auto refuse = [&](int status, const char* text) {
    *refused = RefusedRequest(status, text);
    return nullptr;
  };
  const std::string own = std::to_string(port);
  const auto host = Only(message, http::field::host);
  if (message.version() != 11) return refuse(505, "only HTTP/1.1 is spoken here");
  if (!host || (*host != "127.0.0.1:" + own && *host != "localhost:" + own))
    return refuse(421, "this is not the server of that host");
  if (message.count(http::field::transfer_encoding) > 0)
    return refuse(501, "a body comes with its length, in one piece");
  if (message.count(http::field::origin) > 0 &&
      Only(message, http::field::origin) != "http://" + std::string(*host))
    return refuse(403, "another site may not ask here");
  const std::string_view method = AsStringView(message.method_string()),
                         target = AsStringView(message.target());
  const auto found = std::ranges::find_if(
      routes, [&](const Route& r) { return r.method == method && r.target == target; });
  if (found == routes.end() || !found->open) {
    const auto site = message.find("Sec-Fetch-Site");
    if (site != message.end() && site->value() != "same-origin")
      return refuse(403, "another site may not ask here");
    const auto given = Only(message, http::field::authorization);
    if (!given || !SameSecret(*given, "Bearer " + token))
      return refuse(401, "open the address that regrade view printed");
  }
  if (found == routes.end()) {
    const bool known =
        std::ranges::any_of(routes, [&](const Route& r) { return r.target == target; });
    return known ? refuse(405, "this is not how to ask for it")
                 : refuse(404, "there is nothing of that name");
  }
  const auto length = parser.content_length();
  if (length && *length > found->most_bytes) return refuse(413, "the body is too long");
  return &*found;
}

template <typename Done>
beast::error_code RequestReader::State::Parse(const Done& done) {
  beast::error_code error;
  size_t used = 0;
  while (!done()) {
    const size_t more =
        parser.put(asio::buffer(pending.data() + used, pending.size() - used), error);
    used += more;
    if (error || more == 0) break;
  }
  pending.erase(0, used);
  if (error == http::error::need_more) error = {};
  return error;
}

RequestReader::RequestReader(const std::vector<Route>& routes, const std::string& token,
                             int port)
    : state_(new State{routes, token, port}) {
  state_->parser.header_limit(kMostHeaderBytes);
  state_->parser.body_limit(state_->MostBytes());
}

RequestReader::~RequestReader() = default;

bool RequestReader::header_read() const { return state_->route != nullptr; }

std::optional<HttpResponse> RequestReader::Take(std::string_view bytes) {
  State& s = *state_;
  s.pending += bytes;
  if (s.route == nullptr) {
    // The parser is not eager: nothing behind the header is parsed before it is accepted.
    if (const auto error = s.Parse([&s] { return s.parser.is_header_done(); }))
      return OfError(error);
    if (!s.parser.is_header_done()) {
      if (s.pending.size() > kMostHeaderBytes) return OfError(http::error::header_limit);
      return std::nullopt;
    }
    HttpResponse refused;
    s.route = s.RouteOf(&refused);
    if (s.route == nullptr) return refused;
    s.parser.body_limit(s.route->most_bytes);
    s.parser.eager(true);
  }
  if (const auto error = s.Parse([&s] { return s.parser.is_done(); })) return OfError(error);
  if (!s.parser.is_done()) return std::nullopt;
  return Answer(*s.route, s.parser.get());
}

HttpResponse AnswerBytes(std::string_view bytes, const std::vector<Route>& routes,
                         const std::string& token, int port) {
  constexpr size_t kPiece = 1000;
  RequestReader reader(routes, token, port);
  for (; !bytes.empty(); bytes.remove_prefix(std::min(kPiece, bytes.size())))
    if (auto answer = reader.Take(bytes.substr(0, kPiece))) return std::move(*answer);
  return RefusedRequest(408, "the request has no end");
}

}  // namespace regrade
