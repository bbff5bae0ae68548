#include "pipeline/files/deflate.h"

#include <zlib.h>

#include <algorithm>

#include "kernels/base/error.h"

namespace regrade {

std::string Deflate(std::string_view bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::string packed(size, '\0');
  const int status = compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
                               reinterpret_cast<const Bytef*>(bytes.data()),
                               static_cast<uLong>(bytes.size()), Z_BEST_COMPRESSION);
  if (status != Z_OK) throw ResourceError("there is no memory to compress with");
  packed.resize(size);
  return packed;
}

std::string Inflate(std::string_view packed, uint64_t max_bytes, const std::string& where) {
  constexpr size_t kPiece = 1 << 20;
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) throw ResourceError("there is no memory to unpack", where);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
  size_t left = packed.size();
  std::string bytes;
  int status = Z_OK;
  while (status == Z_OK && bytes.size() <= max_bytes) {
    const size_t in = std::min(left, kPiece), before = bytes.size();
    stream.avail_in = static_cast<uInt>(in);
    bytes.resize(before + kPiece);
    stream.next_out = reinterpret_cast<Bytef*>(bytes.data() + before);
    stream.avail_out = kPiece;
    status = inflate(&stream, Z_NO_FLUSH);
    left -= in - stream.avail_in;
    bytes.resize(before + kPiece - stream.avail_out);
  }
  inflateEnd(&stream);
  if (bytes.size() > max_bytes)
    throw InputError(Concat("unpacks to more than ", max_bytes, " bytes"), where);
  if (status != Z_STREAM_END || left > 0) throw InputError("compressed data is damaged", where);
  return bytes;
}

}  // namespace regrade
