// Decodes files of unknown origin in a child process: a damaged or malicious picture or film
// can crash the library that reads it, fill the memory, or keep it busy for ever.
//
// The child is this program itself under another argument, started when it is needed; it
// decodes one file after the other, ends when there is nothing to do for some seconds, and is
// replaced when it dies. Values come back through a socket as the floats they are.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/images/film_source.h"
#include "pipeline/images/picture_decoder.h"

namespace regrade {

struct DecoderProcess {
  std::vector<std::string> command;  // its program and arguments
  // Wall clock, of one picture or frame, to which a second for each megabyte of the file comes.
  double seconds = 120;
  // Of address space beyond what the child has when it begins; 0: by the sizes that the file
  // can have, see MemoryToDecode.
  int64_t memory_bytes = 0;
};

// From now on files of unknown origin are decoded by such processes; without a command in this
// process, as at the start.
void DecodeApart(const DecoderProcess& process);
bool DecodesApart();

// As DecodePicture and FilmDecoder. Throw Error(kInput) naming the file, too, if the child
// crashes, needs more memory, or is not done in time; Error(kResources) if no child can be
// started. A child that has decoded other files is not blamed for what they left: the file is
// tried again with a new one.
StoredPicture DecodePictureApart(const std::string& path, const DecodeLimits& limits);
std::unique_ptr<FilmSource> OpenFilmApart(const std::string& path, const VideoLimits& limits);

}  // namespace regrade
