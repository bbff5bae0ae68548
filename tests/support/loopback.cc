#include "tests/support/loopback.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

namespace regrade::testing {

Loopback::Loopback(int port, const char* host) : fd_(::socket(AF_INET, SOCK_STREAM, 0)) {
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  ::inet_pton(AF_INET, host, &address.sin_addr);
  connected_ = ::connect(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
}

Loopback::~Loopback() { ::close(fd_); }

bool Loopback::Send(std::string_view bytes) const {
  return ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL) ==
         static_cast<ssize_t>(bytes.size());
}

std::string Loopback::Receive(int seconds) const {
  const timeval limit{seconds, 0};
  ::setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  std::string all;
  char piece[1 << 16];
  for (ssize_t n = 0; (n = ::recv(fd_, piece, sizeof piece, 0)) > 0;)
    all.append(piece, static_cast<size_t>(n));
  return all;
}

}  // namespace regrade::testing
