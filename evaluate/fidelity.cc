#include "evaluate/fidelity.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "evaluate/image_quality.h"
#include "evaluate/optional_mean.h"
#include "evaluate/sliced_wasserstein.h"
#include "kernels/base/error.h"
#include "kernels/base/parallel_tasks.h"
#include "kernels/image/hue_chroma.h"

namespace regrade {
namespace {

void Clip(Image* image) {
  // Not std::clamp, whose result for NaN depends on the order of its comparisons: NaN stays
  // NaN.
  for (float& p : image->pixels)
    if (!std::isnan(p)) p = std::clamp(p, 0.0f, 1.0f);
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
  Image unstyled_edges;
  HueChroma hues_2d;
};

FrameTargets ReadTargets(const FidelityTargets& targets, int i) {
  FrameTargets frame;
  if (targets.unstyled.count > 0) frame.unstyled = targets.unstyled.frame(i);
  if (targets.views_2d.count == 0) return frame;
  frame.view_2d = targets.views_2d.frame(i);
  if (targets.transmittance.count > 0) frame.transmittance = targets.transmittance.frame(i);
  return frame;
}

// What is measured of one frame of one sequence without networks.
struct FrameMeasures {
  HueChroma hues;
  ColourSlices colours;
  std::optional<double> db, structure, edge_ssim;
};

// One frame of every sequence.
struct FrameTask {
  int index = 0;
  FrameTargets target;
  std::vector<Image> frames;  // of the sequences; empty where one has fewer frames
  std::vector<FrameMeasures> measures = {};

  void Run(const FidelityTargets& targets, const std::vector<NamedFrameSource>& sequences) {
    Clip(&target.unstyled);
    Clip(&target.view_2d);
    if (targets.edges && !target.unstyled.empty())
      target.unstyled_edges = targets.edges(target.unstyled);
    if (!targets.only_psnr && !target.view_2d.empty()) target.hues_2d.Add(target.view_2d);
    measures.resize(frames.size());
    for (size_t s = 0; s < frames.size(); ++s) {
      if (frames[s].empty()) continue;
      Clip(&frames[s]);
      Measure(targets, frames[s], sequences[s], &measures[s]);
    }
  }

 private:
  void Measure(const FidelityTargets& targets, const Image& frame,
               const NamedFrameSource& sequence, FrameMeasures* measured) const {
    if (frame.pixels == target.view_2d.pixels && frame.SameSize(target.view_2d))
      measured->hues += target.hues_2d;
    else if (!targets.only_psnr)
      measured->hues.Add(frame);
    if (targets.style != nullptr) measured->colours.Add(frame);
    if (!target.unstyled.empty()) {
      CheckSize(frame, target.unstyled, "the unstyled version", index, sequence);
      measured->structure = GradientCorrelation(frame, target.unstyled);
      if (targets.edges)
        measured->edge_ssim = Ssim(targets.edges(frame), target.unstyled_edges);
    }
    if (target.view_2d.empty()) return;
    CheckSize(frame, target.view_2d, "the 2D method's version", index, sequence);
    const bool masked = !target.transmittance.empty();
    if (masked) CheckSize(frame, target.transmittance, "the transmittance", index, sequence);
    measured->db = Psnr(frame, target.view_2d, masked ? &target.transmittance : nullptr);
  }
};

// What is summed over the frames of a sequence, in their order.
class FidelitySums {
 public:
  FidelitySums(const NamedFrameSource& sequence, const FidelityTargets& targets)
      : sequence_(sequence), targets_(targets) {
    CheckCount(sequence, targets.views_2d, "the 2D method's");
    CheckCount(sequence, targets.unstyled, "the unstyled");
    CheckCount(sequence, targets.transmittance, "transmittance");
  }

  void Add(const FrameTask& task, size_t s) {
    const FrameMeasures& measured = task.measures[s];
    hues_ += measured.hues;
    colours_ += measured.colours;
    structure_.Add(measured.structure);
    edge_ssim_.Add(measured.edge_ssim);
    if (!task.target.view_2d.empty()) hues_2d_ += task.target.hues_2d;
    if (measured.db && std::isfinite(*measured.db)) {
      sum_db_ += *measured.db;
      ++finite_;
    } else if (measured.db) {
      ++perfect_;
    }
    AddByNetwork(task.frames[s], task.target);
  }

  FidelityRow Row(const ColourSlices& style) const {
    FidelityRow row;
    row.sequence = sequence_.name;
    if (finite_ > 0)
      row.psnr_to_2d_db = sum_db_ / finite_;
    else if (perfect_ > 0)
      row.psnr_to_2d_db = std::numeric_limits<double>::infinity();
    row.lpips_to_2d = lpips_.Value();
    row.structure = structure_.Value();
    row.hue_std = hues_.HueStd();
    row.chroma = hues_.MeanChroma();
    row.hue_std_2d = hues_2d_.HueStd();
    row.chroma_2d = hues_2d_.MeanChroma();
    if (targets_.style != nullptr)
      row.sliced_wasserstein_to_style = SlicedWasserstein(colours_, style);
    row.edge_ssim = edge_ssim_.Value();
    return row;
  }

 private:
  // A network runs on one picture at a time, in parallel.
  void AddByNetwork(const Image& frame, const FrameTargets& target) {
    if (!targets_.perceptual || target.view_2d.empty()) return;
    Image whole = target.view_2d;  // excluded pixels are copied: they add no difference
    for (size_t v = 0; v < whole.pixels.size(); ++v)
      if (!std::isfinite(whole.pixels[v])) whole.pixels[v] = frame.pixels[v];
    lpips_.Add(targets_.perceptual(frame, whole));
  }

  const NamedFrameSource& sequence_;
  const FidelityTargets& targets_;
  HueChroma hues_, hues_2d_;
  ColourSlices colours_;
  OptionalMean lpips_, structure_, edge_ssim_;
  double sum_db_ = 0;
  int finite_ = 0, perfect_ = 0;
};

// Reads the frames from `begin` on, as many as are measured at once; from one thread, for a
// source may be anything.
std::vector<FrameTask> ReadTasks(const std::vector<NamedFrameSource>& sequences,
                                 const FidelityTargets& targets, int begin, int end) {
  std::vector<FrameTask> tasks;
  int64_t at_once = 1;
  for (int i = begin; i < end && i - begin < at_once; ++i) {
    FrameTask task{i, ReadTargets(targets, i), {}};
    int64_t values = 0;
    for (const NamedFrameSource& sequence : sequences) {
      task.frames.push_back(i < sequence.frames.count ? sequence.frames.frame(i) : Image());
      values += std::ssize(task.frames.back().pixels);
    }
    if (i == begin) at_once = TasksAtOnce(2 * static_cast<int64_t>(sizeof(float)) * values);
    tasks.push_back(std::move(task));
  }
  return tasks;
}

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
  for (int i = 0; i < frames;) {
    std::vector<FrameTask> tasks = ReadTasks(sequences, targets, i, frames);
    ParallelTasks(0, std::ssize(tasks),
                  [&](int64_t t) { tasks[static_cast<size_t>(t)].Run(targets, sequences); });
    for (const FrameTask& task : tasks)
      for (size_t s = 0; s < sequences.size(); ++s) {
        if (task.frames[s].empty()) continue;
        sums[s].Add(task, s);
        ReportOrThrow(progress, ++done, total);
      }
    i += static_cast<int>(tasks.size());
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
