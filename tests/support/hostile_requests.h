// Requests that a local server must refuse, each with its status.
#pragma once

#include <string>
#include <vector>

#include "kernels/base/error.h"

namespace regrade::testing {

// What a browser sends, with further header lines and a body; an empty token is left out.
inline std::string PlainRequest(const std::string& method, const std::string& target, int port,
                                const std::string& token, const std::string& lines = "",
                                const std::string& body = "") {
  return Concat(method, " ", target, " HTTP/1.1\r\nHost: 127.0.0.1:", port, "\r\n",
                token.empty() ? "" : "Authorization: Bearer " + token + "\r\n", lines,
                body.empty() ? "" : Concat("Content-Length: ", body.size(), "\r\n"), "\r\n",
                body);
}

inline std::string ManyLines(int count) {
  std::string lines;
  for (int i = 0; i < count; ++i) lines += "A: b\r\n";
  return lines;
}

struct HostileRequest {
  std::string name;
  int status;
  std::string bytes;
};

// For a server whose routes are GET / (open), GET /page and POST /style (1 MB).
inline std::vector<HostileRequest> HostileRequests(int port, const std::string& token) {
  const auto get = [&](const std::string& target, const std::string& lines = "") {
    return PlainRequest("GET", target, port, token, lines);
  };
  const auto with_host = [&](const std::string& host) {
    return "GET /page HTTP/1.1\r\n" + host + "Authorization: Bearer " + token + "\r\n\r\n";
  };
  const std::string own = std::to_string(port);
  std::string other = token;
  other[63] = other[63] == 'b' ? 'c' : 'b';
  return {
      {"another host", 421, with_host("Host: example.com\r\n")},
      {"a name that was bound to this machine", 421,
       with_host("Host: evil.test:" + own + "\r\n")},
      {"another port", 421, with_host("Host: 127.0.0.1:1\r\n")},
      {"no port", 421, with_host("Host: 127.0.0.1\r\n")},
      {"a longer name", 421, with_host("Host: 127.0.0.1:" + own + ".evil.test\r\n")},
      {"all addresses", 421, with_host("Host: 0.0.0.0:" + own + "\r\n")},
      {"no host", 421, with_host("")},
      {"two hosts", 421, with_host("Host: 127.0.0.1:" + own + "\r\nHost: evil.test\r\n")},
      {"another host of the open page", 421, "GET / HTTP/1.1\r\nHost: evil.test\r\n\r\n"},
      {"another origin", 403, get("/page", "Origin: https://evil.test\r\n")},
      {"a nameless origin", 403, get("/page", "Origin: null\r\n")},
      {"the origin of another port", 403, get("/page", "Origin: http://127.0.0.1:1\r\n")},
      {"an origin's longer name", 403,
       get("/page", "Origin: http://127.0.0.1:" + own + ".evil.test\r\n")},
      {"two origins", 403,
       get("/page", "Origin: http://127.0.0.1:" + own + "\r\nOrigin: https://evil.test\r\n")},
      {"a request of another site", 403, get("/page", "Sec-Fetch-Site: cross-site\r\n")},
      {"a request of a site of the same name", 403,
       get("/page", "Sec-Fetch-Site: same-site\r\n")},
      {"no token", 401, PlainRequest("GET", "/page", port, "")},
      {"another token", 401, PlainRequest("GET", "/page", port, other)},
      {"half a token", 401, PlainRequest("GET", "/page", port, token.substr(0, 32))},
      {"a longer token", 401, PlainRequest("GET", "/page", port, token + "a")},
      {"a token in the address", 401, PlainRequest("GET", "/page?token=" + token, port, "")},
      {"a token in a cookie", 401,
       PlainRequest("GET", "/page", port, "", "Cookie: token=" + token + "\r\n")},
      {"two tokens", 401,
       PlainRequest("GET", "/page", port, token, "Authorization: Bearer x\r\n")},
      {"an unknown target without a token", 401, PlainRequest("GET", "/x", port, "")},
      {"a file", 404, get("/etc/passwd")},
      {"the folder above", 404, get("/../../etc/passwd")},
      {"the folder above, encoded", 404, get("/%2e%2e/%2e%2e/etc/passwd")},
      {"encoded twice", 404, get("/%252e%252e/etc/passwd")},
      {"backslashes", 404, get("/..\\..\\etc\\passwd")},
      {"a known target from the folder above", 404, get("/x/../page")},
      {"an encoded target", 404, get("/%70age")},
      {"a target and more", 404, get("/page/")},
      {"a query", 404, get("/page?file=/etc/passwd")},
      {"an absolute target", 404, get("http://127.0.0.1:" + own + "/page")},
      {"a zero byte", 400, get(std::string("/page\0x", 7))},
      {"another method", 405, PlainRequest("POST", "/page", port, token, "", "x")},
      {"a proxy's method", 404, PlainRequest("CONNECT", "evil.test:443", port, token)},
      {"a question about other origins", 401,
       PlainRequest("OPTIONS", "/style", port, "", "Access-Control-Request-Method: POST\r\n")},
      {"a body where there is none", 413, get("/page", "Content-Length: 5\r\n") + "12345"},
      {"a chunk where there is none", 501,
       get("/page", "Transfer-Encoding: chunked\r\n") + "1\r\nx\r\n0\r\n\r\n"},
      {"a trailer of 70 kB", 501,
       PlainRequest("GET", "/", port, "", "Transfer-Encoding: chunked\r\n") +
           "0\r\nX: " + std::string(70000, 'a') + "\r\n\r\n"},
      {"an extension of a chunk without end", 501,
       PlainRequest("POST", "/style", port, token, "Transfer-Encoding: chunked\r\n") +
           "1;x=" + std::string(2 << 20, 'a')},
      {"a compressed body", 501,
       PlainRequest("POST", "/style", port, token, "Transfer-Encoding: gzip\r\n")},
      {"a body of 1 GB", 413,
       PlainRequest("POST", "/style", port, token, "Content-Length: 1000000000\r\n")},
      {"a body of 2^64 bytes", 400,
       PlainRequest("POST", "/style", port, token, "Content-Length: 18446744073709551616\r\n")},
      {"a negative length", 400,
       PlainRequest("POST", "/style", port, token, "Content-Length: -1\r\n")},
      {"a length that is no number", 400,
       PlainRequest("POST", "/style", port, token, "Content-Length: 1e2\r\n")},
      {"a chunk of 1 GB", 501,
       PlainRequest("POST", "/style", port, token, "Transfer-Encoding: chunked\r\n") +
           "3b9aca00\r\n" + std::string(2000, 'x')},
      {"two lengths", 400,
       PlainRequest("POST", "/style", port, token,
                    "Content-Length: 3\r\nContent-Length: 4\r\n") +
           "abcd"},
      {"a length and chunks", 400,
       PlainRequest("POST", "/style", port, token,
                    "Content-Length: 3\r\nTransfer-Encoding: chunked\r\n") +
           "abc"},
      {"a header of 1 MB", 431, get("/page", "X: " + std::string(1 << 20, 'x') + "\r\n")},
      {"a header of 4000 lines", 431, get("/page", ManyLines(4000))},
      {"a header without end", 431, get("/page").substr(0, 40) + std::string(1 << 20, 'x')},
      {"a line that is folded", 400, get("/page", "Host: x\n y\r\n")},
      {"an older version", 505, "GET /page HTTP/1.0\r\n\r\n"},
      {"another protocol", 400,
       "\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03 and so on\r\n\r\n"},
      {"nothing", 400, "\r\n\r\n\r\n\r\n"},
  };
}

}  // namespace regrade::testing
