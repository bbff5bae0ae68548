// Unpacks Zstandard (RFC 8878).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace regrade {

// Whether this program was built with libzstd.
bool HaveZstd();

// One frame or several of `bytes` bytes when unpacked. Throws Error(kInput) with `where` for
// bytes that are damaged or of another size, and in a program that was built without libzstd.
std::string UnpackZstd(std::string_view packed, uint64_t bytes, const std::string& where);

}  // namespace regrade
