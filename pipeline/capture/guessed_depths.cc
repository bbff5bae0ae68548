#include "pipeline/capture/guessed_depths.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/base/quantile.h"
#include "kernels/image/resize.h"
#include "pipeline/capture/measured_depths.h"
#include "pipeline/files/text.h"

namespace regrade {
namespace {

constexpr size_t kLeastKnown = 20;
constexpr double kAgreed = 0.05, kMostError = 0.15, kMostOfConstant = 0.5;
constexpr double kBeyond = 2;         // times the depths that are known
constexpr double kLeastError = 0.05;  // of what only a network says
constexpr int kCells = 32;            // along the longer side
constexpr int kPatch = 14, kNetworkSide = 518;

// (a g + b) z^s - 1 of a sample.
struct Row {
  double of_a, of_b;
};

struct Line {
  double a = 0, b = 0, error = INFINITY;
};

// By reweighted least squares; with `constant` a is 0.
Line FitLine(const std::vector<Row>& rows, bool constant) {
  constexpr int kRounds = 40, kHuberRounds = 10;
  constexpr double kSigmaOfMedian = 1.4826;  // of a normal distribution
  Line line;
  std::vector<double> weights(rows.size(), 1.0), left(rows.size());
  for (int round = 0; round < kRounds; ++round) {
    double aa = 0, ab = 0, bb = 0, a1 = 0, b1 = 0;
    for (size_t i = 0; i < rows.size(); ++i) {
      const auto [of_a, of_b] = rows[i];
      aa += weights[i] * of_a * of_a, ab += weights[i] * of_a * of_b;
      bb += weights[i] * of_b * of_b;
      a1 += weights[i] * of_a, b1 += weights[i] * of_b;
    }
    const double determinant = aa * bb - ab * ab;
    if (constant || !(determinant > 1e-12 * aa * bb)) {
      line.a = 0, line.b = b1 / bb;
    } else {
      line.a = (a1 * bb - b1 * ab) / determinant;
      line.b = (b1 * aa - a1 * ab) / determinant;
    }
    for (size_t i = 0; i < rows.size(); ++i) {
      left[i] = std::abs(line.a * rows[i].of_a + line.b * rows[i].of_b - 1);
      const double r = left[i] / kAgreed, falls = 1 / (1 + r * r);
      weights[i] = round < kHuberRounds ? 1 / std::max(1.0, r) : falls * falls;
    }
  }
  line.error = kSigmaOfMedian * Median(left);
  return line;
}

float At(const Image& image, int x, int y) { return image.at(x, y)[0]; }

std::vector<KnownDepth> KnownDepthsOf(const Camera& camera, const std::vector<SeenPoint>& seen,
                                      const Image& guess) {
  std::vector<KnownDepth> known;
  for (const SeenPoint& point : seen) {
    double x, y, depth;
    if (!camera.Project(point.position.Cast<double>(), &x, &y, &depth)) continue;
    if (x >= 0 && y >= 0 && x < camera.width && y < camera.height)
      known.push_back(
          {x * guess.width / camera.width, y * guess.height / camera.height, depth});
  }
  return known;
}

// Where the photo has no points.
int AddOpenPlaces(const Camera& camera, const AlignedGuess& guess,
                  const std::vector<KnownDepth>& known, std::vector<SeenPoint>* points) {
  const Image& z = guess.z;
  const double cell = static_cast<double>(std::max(z.width, z.height)) / kCells;
  const int across = static_cast<int>(std::ceil(z.width / cell)),
            down = static_cast<int>(std::ceil(z.height / cell));
  std::vector<uint8_t> taken(static_cast<size_t>(across) * static_cast<size_t>(down));
  for (const KnownDepth& at : known)
    for (int k = 0; k < 9; ++k) {
      const int u = static_cast<int>(at.x / cell) + k % 3 - 1,
                v = static_cast<int>(at.y / cell) + k / 3 - 1;
      if (u >= 0 && v >= 0 && u < across && v < down)
        taken[static_cast<size_t>(v * across + u)] = 1;
    }
  const RigidTransform world_from_camera = camera.camera_from_world.Inverse();
  const double error = std::max(guess.error, kLeastError);
  int added = 0;
  for (int v = 0; v < down; ++v)
    for (int u = 0; u < across; ++u) {
      const int x = static_cast<int>((u + 0.5) * cell), y = static_cast<int>((v + 0.5) * cell);
      if (taken[static_cast<size_t>(v * across + u)] != 0 || !IsOneSurface(z, x, y)) continue;
      const Vec3d ray = camera.CameraRay((x + 0.5) * camera.width / z.width,
                                         (y + 0.5) * camera.height / z.height);
      if (!(ray.z > 0)) continue;
      const double depth = double{At(z, x, y)};
      points->push_back({(world_from_camera * (ray * (depth / ray.z))).Cast<float>(),
                         static_cast<float>(error * depth)});
      ++added;
    }
  return added;
}

}  // namespace

Image GuessDepth(const OnnxModel& network, const Image& photo) {
  constexpr double kMean[] = {0.485, 0.456, 0.406}, kDeviation[] = {0.229, 0.224, 0.225};
  const double scale =
      static_cast<double>(kNetworkSide) / std::max(photo.width, photo.height) / kPatch;
  const auto side = [&](int pixels) {
    return kPatch * std::max(1, static_cast<int>(std::lround(pixels * scale)));
  };
  const Image small = Resize(photo, side(photo.width), side(photo.height));
  const int64_t n = small.num_pixels();
  std::vector<float> values(static_cast<size_t>(3 * n));
  for (int64_t i = 0; i < n; ++i)
    for (int c = 0; c < 3; ++c) {
      const double color = double{small.pixels[static_cast<size_t>(3 * i + c)]};
      values[static_cast<size_t>(c * n + i)] = static_cast<float>(
          ((std::isfinite(color) ? color : kMean[c]) - kMean[c]) / kDeviation[c]);
    }
  const OnnxArray output =
      network.Run({{"", {1, 3, small.height, small.width}, values.data()}}, {},
                  "one input [1, 3, H, W] with sides that are multiples of 14")[0];
  std::vector<int> shape = output.shape;
  std::erase(shape, 1);
  if (shape.size() != 2)
    network.Refuse("its output is no picture of depths", "give a network of relative depth");
  Image guess(shape[1], shape[0], 1);
  guess.pixels = output.values;
  return guess;
}

std::optional<AlignedGuess> AlignGuess(const Image& guess,
                                       const std::vector<KnownDepth>& known) {
  REGRADE_CHECK(guess.channels == 1);
  Line best;
  bool inverse = true;
  double constant = INFINITY;
  for (const bool as_inverse : {true, false}) {
    std::vector<Row> rows;
    for (const KnownDepth& at : known) {
      const int x = static_cast<int>(at.x), y = static_cast<int>(at.y);
      if (!(at.depth > 0) || x < 0 || y < 0 || x >= guess.width || y >= guess.height) continue;
      const double factor = as_inverse ? at.depth : 1 / at.depth;
      rows.push_back({double{At(guess, x, y)} * factor, factor});
    }
    if (rows.size() < kLeastKnown) return std::nullopt;
    const Line line = FitLine(rows, false);
    constant = std::min(constant, FitLine(rows, true).error);
    if (line.error < best.error) best = line, inverse = as_inverse;
  }
  if (!(best.error <= kMostError) || !(best.error <= kMostOfConstant * constant))
    return std::nullopt;
  const auto [least, most] = std::ranges::minmax(known, {}, &KnownDepth::depth);
  AlignedGuess aligned{guess, best.error};
  for (float& value : aligned.z.pixels) {
    const double at = best.a * double{value} + best.b, z = inverse ? 1 / at : at;
    const bool is_depth = at > 0 && z > least.depth / kBeyond && z < kBeyond * most.depth;
    value = is_depth ? static_cast<float>(z) : 0.0f;
  }
  return aligned;
}

void AddGuessedDepths(const std::string& network, const WorkingViews& views,
                      const std::vector<int>& of, const ProgressFunction& progress,
                      std::vector<std::vector<SeenPoint>>* seen,
                      std::vector<std::string>* notes) {
  REGRADE_CHECK_EQ(seen->size(), of.size());
  const OnnxModel model(network);
  std::vector<std::string> left;
  int64_t added = 0;
  for (size_t k = 0; k < of.size(); ++k) {
    ReportOrThrow(progress, static_cast<double>(k), static_cast<double>(of.size()), "depths");
    const Image photo = views.Photo(of[k]);
    const Camera camera = views.CameraOf(of[k]);
    const Image guess = GuessDepth(model, photo);
    const std::vector<KnownDepth> known = KnownDepthsOf(camera, (*seen)[k], guess);
    if (const std::optional<AlignedGuess> aligned = AlignGuess(guess, known))
      added += AddOpenPlaces(camera, *aligned, known, &(*seen)[k]);
    else
      left.push_back(views.View(of[k]).file);
  }
  std::string note = Concat(added, " guessed depths where photos have no points");
  if (!left.empty())
    note += "; left out, because the photo's points disagree or are few: " + Join(left, ", ");
  notes->push_back(note);
}

}  // namespace regrade
