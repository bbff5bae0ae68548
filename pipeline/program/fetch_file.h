// Fetches one small file over https: the only place from which this program calls a
// host; and the hash by which what was fetched is known.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace regrade {

// 64 lower-case hexadecimal digits, by which a fetched file is known to be the one that was
// meant.
std::string Sha256(std::string_view bytes);

struct FetchRules {
  uint64_t most_bytes = 1 << 20;
  double connect_seconds = 15;
  double seconds = 60;  // in all
  // Takes http://127.0.0.1 in place of https, for tests. No option and no variable sets it.
  bool loopback = false;
};

// The bytes at `address`. Follows redirects to the same host and port only, three at most.
// Certificates are checked against those of the system, whose proxy variables are obeyed.
// Throws Error(kInput) that names the address and the reason; Interrupted after a signal.
std::string FetchFile(const std::string& address, const FetchRules& rules = {});

// Version of the library, for `regrade doctor`.
std::string FetchLibrary();

}  // namespace regrade
