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

}  // namespace

FidelityRow MeasureFidelity(const NamedFrameSource& sequence, const FidelityTargets& targets,
                            const ProgressFunction& progress) {
  CheckCount(sequence, targets.views_2d, "the 2D method's");
  CheckCount(sequence, targets.unstyled, "the unstyled");
  CheckCount(sequence, targets.transmittance, "transmittance");
  HueChroma hues, hues_2d;
  ColourSlices colours, style;
  double sum_db = 0, sum_lpips = 0, sum_structure = 0;
  int compared = 0, with_edges = 0;
  int finite = 0, perfect = 0;
  const int count = sequence.frames.count;
  for (int i = 0; i < count; ++i) {
    const Image frame = Clipped(sequence.frames.frame(i));
    hues.Add(frame);
    if (targets.style != nullptr) colours.Add(frame);
    if (targets.unstyled.count > 0) {
      const Image unstyled = Clipped(targets.unstyled.frame(i));
      CheckSize(frame, unstyled, "the unstyled version", i, sequence);
      if (const std::optional<double> correlation = GradientCorrelation(frame, unstyled)) {
        sum_structure += *correlation;
        ++with_edges;
      }
    }
    if (targets.views_2d.count > 0) {
      const Image target = Clipped(targets.views_2d.frame(i));
      CheckSize(frame, target, "the 2D method's version", i, sequence);
      hues_2d.Add(target);
      if (targets.perceptual) {
        Image whole = target;  // excluded pixels are copied: they add no difference
        for (size_t v = 0; v < whole.pixels.size(); ++v)
          if (!std::isfinite(whole.pixels[v])) whole.pixels[v] = frame.pixels[v];
        sum_lpips += targets.perceptual(frame, whole);
        ++compared;
      }
      Image transmittance;
      if (targets.transmittance.count > 0) {
        transmittance = targets.transmittance.frame(i);
        CheckSize(frame, transmittance, "the transmittance", i, sequence);
      }
      const std::optional<double> db =
          Psnr(frame, target, transmittance.empty() ? nullptr : &transmittance);
      if (db && std::isfinite(*db)) {
        sum_db += *db;
        ++finite;
      } else if (db) {
        ++perfect;
      }
    }
    ReportOrThrow(progress, i + 1, count);
  }

  FidelityRow row;
  row.sequence = sequence.name;
  if (finite > 0)
    row.psnr_to_2d_db = sum_db / finite;
  else if (perfect > 0)
    row.psnr_to_2d_db = std::numeric_limits<double>::infinity();
  if (compared > 0) row.lpips_to_2d = sum_lpips / compared;
  if (with_edges > 0) row.structure = sum_structure / with_edges;
  row.hue_std = hues.HueStd();
  row.chroma = hues.MeanChroma();
  row.hue_std_2d = hues_2d.HueStd();
  row.chroma_2d = hues_2d.MeanChroma();
  if (targets.style != nullptr) {
    style.Add(*targets.style);
    row.sliced_wasserstein_to_style = SlicedWasserstein(colours, style);
  }
  return row;
}

}  // namespace regrade
