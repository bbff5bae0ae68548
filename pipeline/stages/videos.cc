#include "pipeline/stages/videos.h"

#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"

namespace regrade {
namespace {

// The border crosses the frame and returns.
int WipeBorder(int width, int frame, int frames) {
  const double phase = 2.0 * frame / std::max(1, frames - 1);
  return static_cast<int>((phase <= 1 ? phase : 2 - phase) * width);
}

}  // namespace

Image Wipe(const Image& left, const Image& right, int border) {
  Image mixed = left;
  for (int y = 0; y < left.height; ++y)
    for (int x = border; x < left.width; ++x)
      std::copy_n(right.at(x, y), right.channels, mixed.at(x, y));
  return mixed;
}

RunFilms::RunFilms(const Workspace& workspace, double frames_per_second, int frames)
    : workspace_(workspace), frames_per_second_(frames_per_second), frames_(frames) {
  // An earlier film: this run's 2D method may not be able to style rendered frames.
  std::filesystem::remove(workspace.Path(kViews2dFilm));
}

void RunFilms::Begin(const Image& first, bool with_views_2d) {
  width_ = first.width;
  height_ = first.height;
  const auto open = [&](const char* name, std::optional<VideoWriter>* writer) {
    writer->emplace(workspace_.Path(name), width_, height_, frames_per_second_);
  };
  try {
    open(kStyledFilm, &film_);
    open(kWipeFilm, &wipe_);
    if (with_views_2d) open(kViews2dFilm, &frame_by_frame_);
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
    wipe_->Add(Wipe(source, styled, WipeBorder(width_, index, frames_)));
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
  outputs->insert(outputs->end(), {kStyledFilm, kWipeFilm});
  if (!frame_by_frame_) return;
  frame_by_frame_->Finish();
  outputs->push_back(kViews2dFilm);
}

}  // namespace regrade
