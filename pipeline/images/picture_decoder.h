// Decodes a picture file in this process; decoder_process.h does so in another one.
#pragma once

#include <cstdint>
#include <string>

#include "pipeline/images/normalize_photo.h"

namespace regrade {

struct DecodeLimits {
  int64_t max_pixels = 128'000'000;  // checked from the header, before pixels are allocated
  int min_side = 64;                 // pixels
  bool accept_damaged = false;       // JPEG with lost parts: accepted with a notice
};

// The picture, normalized by ApplyPhotoRules; its content decides the format, not its name.
// Throws Error(kInput) for what is not a whole picture, see DecodePhoto (image_file.h).
StoredPicture DecodePicture(const std::string& path, const DecodeLimits& limits);

// The most pixels that a file of so many bytes is allowed to claim.
int64_t MostPixelsOf(int64_t file_bytes);

// Of the libraries that decode, from now on.
void LimitDecodingThreads(int threads);

}  // namespace regrade
