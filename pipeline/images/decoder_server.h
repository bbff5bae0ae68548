// The child of decoder_process.h.
#pragma once

#include <cstdint>

namespace regrade {

// Answers the requests that come through the standard input, until nothing has been asked for
// some seconds or the parent is gone. Does not return.
[[noreturn]] void ServeDecoding();

// Of address space, bytes, for a file of so many bytes that may have `max_pixels`, each of
// which takes `pixel_bytes` while it is decoded: enough for libraries and threads and for as
// many pixels as such a file can have, but no more than the machine's memory.
int64_t MemoryToDecode(int64_t max_pixels, int64_t file_bytes, int64_t pixel_bytes);

}  // namespace regrade
