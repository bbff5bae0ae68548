#include "stylize/image/gaussian_mixture.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/image/color_statistics.h"
#include "stylize/image/part_density.h"

namespace regrade {
namespace {

constexpr int kMostMixtureIterations = 200;
constexpr double kLeastGain = 1e-5;   // nats a colour
constexpr int64_t kColorBlock = 512;  // colours summed by one thread

// Sums over colours, about the part's last mean, which the new one approaches.
struct PartSums {
  double count = 0;
  Vec3d first{};
  Mat3d second = kZeroMat3d;

  void Add(double weight, const Vec3d& d) {
    count += weight;
    first += d * weight;
    for (int i = 0; i < 3; ++i) second.row[i] += d * (weight * d[i]);
  }
  void Add(const PartSums& o) {
    count += o.count;
    first += o.first;
    for (int i = 0; i < 3; ++i) second.row[i] += o.second.row[i];
  }
};

struct Expectation {
  std::vector<PartSums> parts;
  double log_likelihood = 0;  // a colour
};

// Blocks are summed in their order, whatever the number of threads.
Expectation Expect(const GaussianMixture& mixture, const std::vector<Vec3d>& colors) {
  const size_t parts = mixture.size();
  const std::vector<PartDensity> densities = DensitiesOf(mixture, 0);
  const int64_t count = std::ssize(colors), blocks = (count + kColorBlock - 1) / kColorBlock;
  std::vector<Expectation> of_blocks(static_cast<size_t>(blocks));
#pragma omp parallel for schedule(static)
  for (int64_t block = 0; block < blocks; ++block) {
    Expectation& sums = of_blocks[static_cast<size_t>(block)];
    sums.parts.resize(parts);
    std::vector<double> shares(parts);
    for (int64_t i = block * kColorBlock; i < std::min(count, (block + 1) * kColorBlock); ++i) {
      const Vec3d& color = colors[static_cast<size_t>(i)];
      sums.log_likelihood += SharesOf(densities, color, shares.data());
      for (size_t k = 0; k < parts; ++k) sums.parts[k].Add(shares[k], color - mixture[k].mean);
    }
  }
  Expectation all;
  all.parts.resize(parts);
  for (const Expectation& block : of_blocks) {
    for (size_t k = 0; k < parts; ++k) all.parts[k].Add(block.parts[k]);
    all.log_likelihood += block.log_likelihood / static_cast<double>(count);
  }
  return all;
}

// The mixture of the sums; parts without colours are left out.
GaussianMixture Maximised(const GaussianMixture& last, const std::vector<PartSums>& sums) {
  constexpr double kEmpty = 1e-9;  // of all colours
  double total = 0;
  for (const PartSums& part : sums) total += part.count;
  GaussianMixture mixture;
  double kept = 0;
  for (size_t k = 0; k < sums.size(); ++k) {
    const PartSums& part = sums[k];
    if (part.count <= kEmpty * total) continue;
    const Vec3d shift = part.first / part.count;
    Mat3d covariance;
    for (int i = 0; i < 3; ++i)
      covariance.row[i] = part.second.row[i] / part.count - shift * shift[i];
    mixture.push_back({part.count, last[k].mean + shift,
                       WidenedCovariance(covariance, kPartVarianceFloor), last[k].height});
    kept += part.count;
  }
  for (GaussianPart& part : mixture) part.weight /= kept;
  return mixture;
}

// The sums that `prior` stands for as `count` colours, about the means of `mixture`.
void AddPrior(const GaussianMixture& prior, double count, const GaussianMixture& mixture,
              std::vector<PartSums>* sums) {
  for (size_t k = 0; k < prior.size(); ++k) {
    const double weight = count * prior[k].weight;
    (*sums)[k].Add(weight, prior[k].mean - mixture[k].mean);
    for (int i = 0; i < 3; ++i) (*sums)[k].second.row[i] += prior[k].covariance.row[i] * weight;
  }
}

GaussianMixture Iterate(GaussianMixture mixture, const std::vector<Vec3d>& colors,
                        const GaussianMixture* prior) {
  Expectation now = Expect(mixture, colors);
  for (int i = 0; i < kMostMixtureIterations; ++i) {
    if (prior != nullptr)
      AddPrior(*prior, kPriorShare * static_cast<double>(colors.size()), mixture, &now.parts);
    GaussianMixture next = Maximised(mixture, now.parts);
    Expectation then = Expect(next, colors);
    if (!(then.log_likelihood - now.log_likelihood >= kLeastGain)) break;
    mixture = std::move(next);
    now = std::move(then);
  }
  return mixture;
}

// Colours far from each other: each is drawn with the squared distance to those before it.
std::vector<Vec3d> Centres(const std::vector<Vec3d>& colors, int parts, uint64_t seed) {
  constexpr uint64_t kStream = 0x6d6d;
  std::vector<double> squared(colors.size(), 1e300);
  std::vector<Vec3d> centres = {
      colors[RandomIndex(seed, kStream, 0, static_cast<uint64_t>(colors.size()))]};
  while (std::ssize(centres) < parts) {
    double sum = 0, farthest = 0;
    for (size_t i = 0; i < colors.size(); ++i) {
      const Vec3d d = colors[i] - centres.back();
      squared[i] = std::min(squared[i], Dot(d, d));
      sum += squared[i];
      farthest = std::max(farthest, squared[i]);
    }
    if (farthest <= kPartVarianceFloor) break;
    double place = sum * RandomDouble(seed, kStream, centres.size());
    size_t drawn = 0;
    while (drawn + 1 < colors.size() && (place -= squared[drawn]) >= 0) ++drawn;
    centres.push_back(colors[drawn]);
  }
  return centres;
}

GaussianMixture NearestCentres(const std::vector<Vec3d>& centres,
                               const std::vector<Vec3d>& colors) {
  GaussianMixture mixture;
  for (const Vec3d& centre : centres) mixture.push_back({1, centre, kZeroMat3d});
  std::vector<PartSums> sums(centres.size());
  for (const Vec3d& color : colors) {
    size_t nearest = 0;
    for (size_t k = 1; k < centres.size(); ++k)
      if (Norm(color - centres[k]) < Norm(color - centres[nearest])) nearest = k;
    sums[nearest].Add(1, color - centres[nearest]);
  }
  return Maximised(mixture, sums);
}

}  // namespace

Mat3d WidenedCovariance(const Mat3d& covariance, double least) {
  const EigenSystem eigen = SymmetricEigen(covariance);
  if (eigen.values.x >= least) return covariance;
  Mat3d result = kZeroMat3d;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int e = 0; e < 3; ++e)
        result(i, j) +=
            std::max(eigen.values[e], least) * eigen.vectors(i, e) * eigen.vectors(j, e);
  return result;
}

GaussianMixture FitMixture(const std::vector<Vec3d>& colors, int parts, uint64_t seed) {
  REGRADE_CHECK(!colors.empty() && parts >= 1);
  return Iterate(NearestCentres(Centres(colors, parts, seed), colors), colors, nullptr);
}

GaussianMixture AdaptMixture(const GaussianMixture& prior, const std::vector<Vec3d>& colors) {
  REGRADE_CHECK(!colors.empty() && !prior.empty());
  return Iterate(prior, colors, &prior);
}

void MeasureHeights(const std::vector<Vec3d>& colors, const std::vector<double>& heights,
                    GaussianMixture* mixture) {
  REGRADE_CHECK(colors.size() == heights.size());
  const std::vector<PartDensity> densities = DensitiesOf(*mixture, 0);
  std::vector<double> shares(mixture->size()), weight(mixture->size()), sum(mixture->size());
  for (size_t i = 0; i < colors.size(); ++i) {
    SharesOf(densities, colors[i], shares.data());
    for (size_t k = 0; k < shares.size(); ++k) {
      weight[k] += shares[k];
      sum[k] += shares[k] * heights[i];
    }
  }
  for (size_t k = 0; k < mixture->size(); ++k)
    if (weight[k] > 0) (*mixture)[k].height = sum[k] / weight[k];
}

}  // namespace regrade
