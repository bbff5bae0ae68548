// Compresses bytes in zlib's container (RFC 1950), which browsers read as "deflate", and in
// gzip's (RFC 1952); unpacks both.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace regrade {

// Equal bytes give equal results, with any number of threads.
std::string Deflate(std::string_view bytes);
// As a gzip file of one member, without a name or a time.
std::string Gzip(std::string_view bytes);

// Throws Error(kInput) with `where` for bytes that are damaged, followed by others, or larger
// than `max_bytes` when unpacked.
std::string Inflate(std::string_view packed, uint64_t max_bytes, const std::string& where);

// The same for a gzip file of one member.
std::string Gunzip(std::string_view packed, uint64_t max_bytes, const std::string& where);

}  // namespace regrade
