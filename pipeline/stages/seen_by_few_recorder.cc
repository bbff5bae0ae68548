#include "pipeline/stages/seen_by_few_recorder.h"

#include <algorithm>
#include <optional>

namespace regrade {
namespace {

constexpr int kMostFilmFrames = 100;

// Of a set of the film's frames, each n-th is looked at.
int StrideOf(const FrameSet& set) {
  const int frames = static_cast<int>(set.cameras.size());
  return set.of_photos ? 1 : std::max(1, (frames + kMostFilmFrames - 1) / kMostFilmFrames);
}

}  // namespace

bool SeenByFewRecorder::LooksAt(const FrameSet& set, int index) {
  return (set.prefix.empty() || set.of_film) && index % StrideOf(set) == 0;
}

SampledView SeenByFewRecorder::Sample(const FrameSet& set, int index,
                                      const Image& depth) const {
  return SampleView(set.cameras[static_cast<size_t>(index)], depth,
                    set.prefix.empty() ? views_.Mask(index) : Image());
}

void SeenByFewRecorder::Finish(const FrameSet& set) {
  if (set.prefix.empty())
    for (const int i : views_.Training()) photos_.push_back(current_[static_cast<size_t>(i)]);
  std::vector<Metric> shares;
  for (const SampledView& view : current_)
    shares.push_back(Metric(SeenByFew(view, photos_, near_), "the view shows no surface"));
  current_.clear();
  if (set.of_film) SetFilm(shares, StrideOf(set));
  if (set.prefix.empty()) metrics_.photos = std::move(shares);
}

void SeenByFewRecorder::SetFilm(const std::vector<Metric>& shares, int stride) {
  double sum = 0;
  int count = 0;
  for (size_t i = 0; i < shares.size(); ++i) {
    const std::optional<double>& share = shares[i].value;
    if (!share) continue;
    sum += *share, ++count;
    if (count > 1 && *share <= *metrics_.worst_frame.value) continue;
    metrics_.worst_frame = *share;
    metrics_.worst_frame_number = static_cast<int>(i) * stride;
  }
  metrics_.film =
      count > 0 ? Metric(sum / count) : Metric::Undefined("no frame shows a surface");
  if (count == 0) metrics_.worst_frame = metrics_.film;
}

}  // namespace regrade
