#include "pipeline/stages/videos.h"

#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr const char *kFilm = "styled.mp4", *kWipe = "source_vs_styled.mp4",
                     *kFrameByFrame = "views_2d.mp4";

// Left of the border the one, right of it the other; the border crosses the frame and returns.
Image Wiped(const Image& left, const Image& right, int frame, int frames) {
  const double phase = 2.0 * frame / std::max(1, frames - 1);
  const double share = phase <= 1 ? phase : 2 - phase;
  const int border = static_cast<int>(share * left.width);
  Image mixed = left;
  for (int y = 0; y < left.height; ++y)
    for (int x = border; x < left.width; ++x)
      std::copy_n(right.at(x, y), right.channels, mixed.at(x, y));
  return mixed;
}

}  // namespace

RunFilms::RunFilms(const Workspace& workspace, double frames_per_second, int frames)
    : workspace_(workspace), frames_per_second_(frames_per_second), frames_(frames) {
  // Of a method that could style renders; what comes now may not.
  std::filesystem::remove(workspace.Path(kFrameByFrame));
}

void RunFilms::Begin(const Image& first, bool with_views_2d) {
  width_ = first.width;
  height_ = first.height;
  const auto open = [&](const char* name, std::optional<VideoWriter>* writer) {
    writer->emplace(workspace_.Path(name), width_, height_, frames_per_second_);
  };
  try {
    open(kFilm, &film_);
    open(kWipe, &wipe_);
    if (with_views_2d) open(kFrameByFrame, &frame_by_frame_);
  } catch (const Error& error) {
    if (error.code() != ExitCode::kExternalProgram) throw;
    GiveUp(error.what_failed());
  }
}

void RunFilms::Add(int index, const Image& source, const Image& styled, const Image* views_2d) {
  if (index == 0) Begin(styled, views_2d != nullptr);
  if (!why_none_.empty()) return;
  REGRADE_CHECK_EQ(styled.width, width_);
  REGRADE_CHECK_EQ(styled.height, height_);
  try {
    film_->Add(styled);
    wipe_->Add(Wiped(source, styled, index, frames_));
    if (frame_by_frame_ && views_2d != nullptr) frame_by_frame_->Add(*views_2d);
  } catch (const Error& error) {
    if (error.code() != ExitCode::kExternalProgram) throw;
    GiveUp(error.what_failed());
  }
}

void RunFilms::GiveUp(const std::string& why) {
  why_none_ = why;
  film_.reset();
  wipe_.reset();
  frame_by_frame_.reset();
}

void RunFilms::Finish(std::vector<std::string>* outputs) {
  if (!film_) return;
  film_->Finish();
  wipe_->Finish();
  outputs->insert(outputs->end(), {kFilm, kWipe});
  if (!frame_by_frame_) return;
  frame_by_frame_->Finish();
  outputs->push_back(kFrameByFrame);
}

}  // namespace regrade
