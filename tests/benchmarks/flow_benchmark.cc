// Measures the evaluator's flow methods against exact motion: how far off they are, which
// hidden pixels their masks find, what they make of the consistency of frames that are
// consistent, and how long they take. Prints tables for COSTS.md.
//
//   flow_benchmark pairs DIR      DIR/00001_img1.ppm, 00001_img2.ppm, 00001_flow.flo, ...
//   flow_benchmark capture DIR    what `regrade synth` wrote
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <string>
#include <vector>

#include "evaluate/consistency.h"
#include "evaluate/flow_file.h"
#include "evaluate/optical_flow.h"
#include "kernels/base/error.h"
#include "pipeline/images/image_file.h"

namespace regrade {
namespace {

const std::vector<std::string> kMethods = {"dis-ultrafast", "dis-fast", "dis-medium",
                                           "dis-tuned", "farneback"};

// Sums over pairs of frames; printed as means.
struct Mean {
  double sum = 0, count = 0;
  void Add(double value, double weight = 1) {
    sum += weight * value;
    count += weight;
  }
  double Value() const { return count > 0 ? sum / count : std::nan(""); }
};

// CPU milliseconds of all threads: other work on the machine does not count.
double CpuMilliseconds() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

double EndPointError(const float* a, const float* b) {
  return std::hypot(a[0] - b[0], a[1] - b[1]);
}

void MeasurePairs(const std::string& folder) {
  std::printf("| flow | mean end-point error, px, by pair | ms a pair |\n|---|---|---|\n");
  for (const std::string& method : kMethods) {
    std::string errors;
    Mean milliseconds;
    for (int i = 1;; ++i) {
      char stem[16];
      std::snprintf(stem, sizeof(stem), "/%05d", i);
      if (!std::filesystem::exists(folder + stem + "_flow.flo")) break;
      const FlowField truth = ReadFlowFile(folder + stem + "_flow.flo");
      const Image from = ReadImage(folder + stem + "_img1.ppm"),
                  to = ReadImage(folder + stem + "_img2.ppm");
      const double start = CpuMilliseconds();
      const FlowField flow = ComputeFlow(from, to, method);
      ComputeFlow(to, from, method);  // a mask needs both directions
      milliseconds.Add(CpuMilliseconds() - start);
      Mean error;
      for (int y = 0; y < truth.height; ++y)
        for (int x = 0; x < truth.width; ++x)
          if (std::isfinite(truth.at(x, y)[0]))
            error.Add(EndPointError(flow.at(x, y), truth.at(x, y)));
      char text[32];
      std::snprintf(text, sizeof(text), "%s%.2f", errors.empty() ? "" : ", ", error.Value());
      errors += text;
    }
    std::printf("| %s | %s | %.0f |\n", method.c_str(), errors.c_str(), milliseconds.Value());
  }
}

// One consecutive pair of a synthetic capture with its truth.
struct TruePair {
  Image earlier, later;
  PairMotion truth;
};

TruePair ReadPair(const std::string& folder, int i) {
  char from[16], to[16];
  std::snprintf(from, sizeof(from), "%05d", i);
  std::snprintf(to, sizeof(to), "%05d", i + 1);
  TruePair pair{ReadImage(folder + "/images/" + from + ".png"),
                ReadImage(folder + "/images/" + to + ".png"),
                {}};
  pair.truth.flow = ReadFlowFile(folder + "/truth/flow/" + FlowFileName(i, i + 1));
  pair.truth.mask.weight =
      ReadImage(folder + "/truth/visible/" + from + std::string("_") + to + ".png");
  return pair;
}

// What a mask does with the pixels that the later frame does not show.
struct MaskCount {
  double hidden = 0, removed = 0, both = 0, pixels = 0;
  Mean psnr_db;
};

struct MethodMetrics {
  Mean error, trusted_error, milliseconds;
  MaskCount lai, ruder;
};

void CountMask(const TruePair& pair, const PairMotion& motion, MaskCount* count) {
  const Image &seen = pair.truth.mask.weight, &kept = motion.mask.weight;
  for (size_t i = 0; i < seen.pixels.size(); ++i) {
    const bool hidden = seen.pixels[i] < 0.5f, removed = kept.pixels[i] < 0.5f;
    count->hidden += hidden;
    count->removed += removed;
    count->both += hidden && removed;
    ++count->pixels;
  }
  const PairResult result = ComparePair(pair.earlier, pair.later, motion);
  if (result.psnr_db && std::isfinite(*result.psnr_db)) count->psnr_db.Add(*result.psnr_db);
}

void MeasureMethod(const TruePair& pair, const std::string& method, MethodMetrics* metrics) {
  const double start = CpuMilliseconds();
  const FlowField forward = ComputeFlow(pair.earlier, pair.later, method);
  const FlowField backward = ComputeFlow(pair.later, pair.earlier, method);
  metrics->milliseconds.Add(CpuMilliseconds() - start);
  const PairMotion lai{forward, MaskLai2018(forward, backward)},
      ruder{forward, MaskRuder2016(forward, backward)};
  CountMask(pair, lai, &metrics->lai);
  CountMask(pair, ruder, &metrics->ruder);
  for (int y = 0; y < forward.height; ++y)
    for (int x = 0; x < forward.width; ++x) {
      const float* truth = pair.truth.flow.at(x, y);
      if (*pair.truth.mask.weight.at(x, y) < 0.5f || !std::isfinite(truth[0])) continue;
      const double error = EndPointError(forward.at(x, y), truth);
      metrics->error.Add(error);
      if (*lai.mask.weight.at(x, y) > 0) metrics->trusted_error.Add(error);
    }
}

void PrintRow(const std::string& method, const MethodMetrics& f) {
  std::printf("| %s | %.2f | %.2f ", method.c_str(), f.error.Value(), f.trusted_error.Value());
  for (const MaskCount* mask : {&f.lai, &f.ruder})
    std::printf("| %.2f / %.2f | %.2f | %.2f ", mask->both / mask->removed,
                mask->both / mask->hidden, 1 - mask->removed / mask->pixels,
                mask->psnr_db.Value());
  std::printf("| %.0f |\n", f.milliseconds.Value());
}

void MeasureCapture(const std::string& folder) {
  std::vector<MethodMetrics> metrics(kMethods.size());
  Mean true_psnr, motion, seen;
  for (int i = 0; std::filesystem::exists(folder + "/truth/flow/" + FlowFileName(i, i + 1));
       ++i) {
    const TruePair pair = ReadPair(folder, i);
    for (size_t m = 0; m < kMethods.size(); ++m) MeasureMethod(pair, kMethods[m], &metrics[m]);
    const PairResult exact = ComparePair(pair.earlier, pair.later, pair.truth);
    true_psnr.Add(*exact.psnr_db);
    seen.Add(exact.coverage);
    const float still[2] = {0, 0};
    for (int y = 0; y < pair.earlier.height; ++y)
      for (int x = 0; x < pair.earlier.width; ++x)
        if (*pair.truth.mask.weight.at(x, y) > 0.5f)
          motion.Add(EndPointError(pair.truth.flow.at(x, y), still));
  }
  std::printf(
      "%.0f pairs, %.1f px of motion on average, %.2f of the pixels seen in both; with "
      "the exact flow and mask: TC-PSNR %.2f dB\n\n",
      seen.count, motion.Value(), seen.Value(), true_psnr.Value());
  std::printf(
      "| flow | error, px | of trusted | lai2018: precision / recall | kept | TC-PSNR "
      "| ruder2016: precision / recall | kept | TC-PSNR | ms a pair |\n"
      "|---|---|---|---|---|---|---|---|---|---|\n");
  for (size_t m = 0; m < kMethods.size(); ++m) PrintRow(kMethods[m], metrics[m]);
}

}  // namespace
}  // namespace regrade

int main(int count, char** words) {
  const std::string what = count == 3 ? words[1] : "";
  try {
    if (what == "pairs") {
      regrade::MeasurePairs(words[2]);
    } else if (what == "capture") {
      regrade::MeasureCapture(words[2]);
    } else {
      std::fprintf(stderr, "flow_benchmark pairs|capture DIR\n");
      return 2;
    }
  } catch (const regrade::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 3;
  }
}
