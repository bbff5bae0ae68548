#include "pipeline/images/video_reader.h"

#include <limits>

#include "kernels/base/error.h"
#include "pipeline/images/decoder_process.h"
#include "pipeline/images/film_decoder.h"

namespace regrade {

VideoReader::VideoReader(const std::string& path, const VideoLimits& limits)
    : source_(DecodesApart() ? OpenFilmApart(path, limits)
                             : std::make_unique<FilmDecoder>(path, limits)) {}

int CountVideoFrames(const std::string& path) {
  constexpr int64_t kAny = std::numeric_limits<int32_t>::max();
  try {
    FilmDecoder film(path, {.max_seconds = 1e9,
                            .max_frames = kAny,
                            .max_decoded_pixels = std::numeric_limits<int64_t>::max(),
                            .every_frame = true});
    int frames = 0;
    while (film.Next()) ++frames;
    return frames;
  } catch (const Error&) {
    return -1;
  }
}

}  // namespace regrade
