#include "pipeline/program/sha256.h"

#include <openssl/evp.h>

#include "kernels/base/error.h"

namespace regrade {

std::string Sha256(std::string_view bytes) {
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned size = 0;
  REGRADE_CHECK(EVP_Digest(bytes.data(), bytes.size(), digest, &size, EVP_sha256(), nullptr) ==
                1);
  std::string text;
  for (unsigned i = 0; i < size; ++i) text += Format("%02x", digest[i]);
  return text;
}

}  // namespace regrade
