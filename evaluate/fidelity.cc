#include "evaluate/fidelity.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "evaluate/image_quality.h"
#include "evaluate/sliced_wasserstein.h"
#include "kernels/base/error.h"
#include "kernels/image/hue_chroma.h"

namespace regrade {
namespace {

Image Clipped(Image image) {
  // Not std::clamp, whose result for NaN depends on the order of its comparisons: NaN stays
  // NaN.
  for (float& p : image.pixels)
    if (!std::isnan(p)) p = std::clamp(p, 0.0f, 1.0f);
  return image;
}

void CheckCount(const NamedFrameSource& sequence, const FrameSource& other,
                const std::string& what) {
  if (other.count == 0 || other.count == sequence.frames.count) return;
  throw InputError(
      Concat("the sequence has ", sequence.frames.count, " frames, ", what, " ", other.count),
      sequence.name, "fidelity needs the same number of frames");
}

void CheckSize(const Image& frame, const Image& other, const std::string& what, int index,
               const NamedFrameSource& sequence) {
  if (frame.SameSize(other)) return;
  throw InputError(Concat(what, " of frame ", index, " has another size: ", other.width, " x ",
                          other.height, " px instead of ", frame.width, " x ", frame.height),
                   sequence.name);
}

// The references of one frame; each may be empty.
struct FrameTargets {
  Image view_2d, unstyled, transmittance;
  HueChroma hues_2d;
};

FrameTargets ReadTargets(const FidelityTargets& targets, int i) {
  FrameTargets frame;
  if (targets.unstyled.count > 0) frame.unstyled = Clipped(targets.unstyled.frame(i));
  if (targets.views_2d.count == 0) return frame;
  frame.view_2d = Clipped(targets.views_2d.frame(i));
  if (!targets.only_psnr) frame.hues_2d.Add(frame.view_2d);
  if (targets.transmittance.count > 0) frame.transmittance = targets.transmittance.frame(i);
  return frame;
}

// What is summed over the frames of a sequence.
class FidelitySums {
 public:
  FidelitySums(const NamedFrameSource& sequence, const FidelityTargets& targets)
      : sequence_(sequence), targets_(targets) {
    CheckCount(sequence, targets.views_2d, "the 2D method's");
    CheckCount(sequence, targets.unstyled, "the unstyled");
    CheckCount(sequence, targets.transmittance, "transmittance");
  }

  void Add(int i, const FrameTargets& target) {
    const Image frame = Clipped(sequence_.frames.frame(i));
    if (frame.pixels == target.view_2d.pixels && frame.SameSize(target.view_2d))
      hues_ += target.hues_2d;
    else if (!targets_.only_psnr)
      hues_.Add(frame);
    if (targets_.style != nullptr) colours_.Add(frame);
    if (!target.unstyled.empty()) {
      CheckSize(frame, target.unstyled, "the unstyled version", i, sequence_);
      if (const auto correlation = GradientCorrelation(frame, target.unstyled)) {
        sum_structure_ += *correlation;
        ++with_edges_;
      }
    }
    if (!target.view_2d.empty()) AddToTarget(frame, i, target);
  }

  FidelityRow Row(const ColourSlices& style) const {
    FidelityRow row;
    row.sequence = sequence_.name;
    if (finite_ > 0)
      row.psnr_to_2d_db = sum_db_ / finite_;
    else if (perfect_ > 0)
      row.psnr_to_2d_db = std::numeric_limits<double>::infinity();
    if (compared_ > 0) row.lpips_to_2d = sum_lpips_ / compared_;
    if (with_edges_ > 0) row.structure = sum_structure_ / with_edges_;
    row.hue_std = hues_.HueStd();
    row.chroma = hues_.MeanChroma();
    row.hue_std_2d = hues_2d_.HueStd();
    row.chroma_2d = hues_2d_.MeanChroma();
    if (targets_.style != nullptr)
      row.sliced_wasserstein_to_style = SlicedWasserstein(colours_, style);
    return row;
  }

 private:
  void AddToTarget(const Image& frame, int i, const FrameTargets& target) {
    CheckSize(frame, target.view_2d, "the 2D method's version", i, sequence_);
    hues_2d_ += target.hues_2d;
    if (targets_.perceptual) {
      Image whole = target.view_2d;  // excluded pixels are copied: they add no difference
      for (size_t v = 0; v < whole.pixels.size(); ++v)
        if (!std::isfinite(whole.pixels[v])) whole.pixels[v] = frame.pixels[v];
      sum_lpips_ += targets_.perceptual(frame, whole);
      ++compared_;
    }
    if (!target.transmittance.empty())
      CheckSize(frame, target.transmittance, "the transmittance", i, sequence_);
    const std::optional<double> db = Psnr(
        frame, target.view_2d, target.transmittance.empty() ? nullptr : &target.transmittance);
    if (db && std::isfinite(*db)) {
      sum_db_ += *db;
      ++finite_;
    } else if (db) {
      ++perfect_;
    }
  }

  const NamedFrameSource& sequence_;
  const FidelityTargets& targets_;
  HueChroma hues_, hues_2d_;
  ColourSlices colours_;
  double sum_db_ = 0, sum_lpips_ = 0, sum_structure_ = 0;
  int compared_ = 0, with_edges_ = 0;
  int finite_ = 0, perfect_ = 0;
};

}  // namespace

std::vector<FidelityRow> MeasureFidelities(const std::vector<NamedFrameSource>& sequences,
                                           const FidelityTargets& targets,
                                           const ProgressFunction& progress) {
  std::vector<FidelitySums> sums;
  int frames = 0;
  int64_t total = 0, done = 0;
  for (const NamedFrameSource& sequence : sequences) {
    sums.emplace_back(sequence, targets);
    frames = std::max(frames, sequence.frames.count);
    total += sequence.frames.count;
  }
  for (int i = 0; i < frames; ++i) {
    const FrameTargets target = ReadTargets(targets, i);
    for (size_t s = 0; s < sequences.size(); ++s) {
      if (i >= sequences[s].frames.count) continue;
      sums[s].Add(i, target);
      ReportOrThrow(progress, ++done, total);
    }
  }
  ColourSlices style;
  if (targets.style != nullptr) style.Add(*targets.style);
  std::vector<FidelityRow> rows;
  for (const FidelitySums& sum : sums) rows.push_back(sum.Row(style));
  return rows;
}

FidelityRow MeasureFidelity(const NamedFrameSource& sequence, const FidelityTargets& targets,
                            const ProgressFunction& progress) {
  return MeasureFidelities({sequence}, targets, progress).front();
}

}  // namespace regrade
