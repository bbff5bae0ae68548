// Decodes a film in this process.
#pragma once

#include <memory>
#include <string>

#include "pipeline/images/film_source.h"

namespace regrade {

class FilmDecoder final : public FilmSource {
 public:
  explicit FilmDecoder(const std::string& path, const VideoLimits& limits = {});
  ~FilmDecoder() override;
  FilmDecoder(const FilmDecoder&) = delete;
  FilmDecoder& operator=(const FilmDecoder&) = delete;

  const VideoInfo& info() const override;
  bool Next() override;
  const FrameInfo& frame() const override;
  Image Picture() override;
  Image Grey(int longer_side) override;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace regrade
