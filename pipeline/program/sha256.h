// SHA-256, by which a fetched file is known to be the one that was meant.
#pragma once

#include <string>
#include <string_view>

namespace regrade {

// 64 lower-case hexadecimal digits.
std::string Sha256(std::string_view bytes);

}  // namespace regrade
