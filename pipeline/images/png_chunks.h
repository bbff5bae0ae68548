// Checks a PNG's chunks by their own checksums, which decoders do late, partly or not at all.
#pragma once

#include <string>
#include <string_view>

namespace regrade {

// Empty if every chunk up to and with IEND is whole and its CRC-32 holds; otherwise the reason
// with the byte offset. Bytes behind IEND are nobody's business. `bytes` begin with PNG's
// signature.
std::string FindPngDamage(std::string_view bytes);

}  // namespace regrade
