#include "pipeline/stages/videos.h"

#include <algorithm>
#include <filesystem>
#include <future>
#include <utility>

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

RunFilms::RunFilms(std::string folder, double frames_per_second, int frames,
                   double views_2d_per_second)
    : folder_(std::move(folder)),
      frames_per_second_(frames_per_second),
      views_2d_per_second_(views_2d_per_second),
      frames_(frames) {}

void RunFilms::Open(const char* name, const Image& first, double frames_per_second,
                    std::optional<VideoWriter>* writer) {
  if (!*writer)
    writer->emplace(folder_ + "/" + name, first.width, first.height, frames_per_second);
}

void RunFilms::Add(int index, const Image& source, const Image& styled) {
  if (!why_none_.empty()) return;
  try {
    Open(kStyledFilm, styled, frames_per_second_, &film_);
    Open(kWipeFilm, styled, frames_per_second_, &wipe_);
    std::future<void> beside = std::async(std::launch::async, [&] {
      wipe_->Add(Wipe(source, styled, WipeBorder(styled.width, index, frames_)));
    });
    film_->Add(styled);
    beside.get();
  } catch (const Error& error) {
    if (error.code() != ExitCode::kExternalProgram) throw;
    GiveUp(error.what_failed());
  }
}

void RunFilms::AddViews2d(const Image& views_2d) {
  if (!why_none_.empty()) return;
  try {
    Open(kViews2dFilm, views_2d, views_2d_per_second_, &frame_by_frame_);
    frame_by_frame_->Add(views_2d);
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
  if (film_) {
    std::future<void> beside = std::async(std::launch::async, [this] { wipe_->Finish(); });
    film_->Finish();
    beside.get();
    outputs->insert(outputs->end(), {kStyledFilm, kWipeFilm});
  }
  if (!frame_by_frame_) return;
  frame_by_frame_->Finish();
  outputs->push_back(kViews2dFilm);
}

}  // namespace regrade
