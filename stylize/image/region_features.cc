#include "stylize/image/region_features.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/image/color_spaces.h"
#include "kernels/image/gaussian_blur.h"
#include "kernels/image/resize.h"
#include "stylize/image/network_pictures.h"
#include "stylize/image/onnx_network.h"
#include "stylize/image/view_stylizer.h"

namespace regrade {
namespace {

constexpr int kColors = 6;  // two scales

Image SmallCopy(const Image& picture) {
  const Image colors = Colors(picture);
  const double scale = static_cast<double>(kRegionSide) / std::max(colors.width, colors.height);
  const auto side = [scale](int n) {
    return std::max(1, static_cast<int>(std::lround(scale * n)));
  };
  return Resize(colors, side(colors.width), side(colors.height));
}

Image LabOf(const Image& colors) {
  Image lab = colors;
  for (int64_t i = 0; i < colors.num_pixels(); ++i) {
    float* const p = &lab.pixels[static_cast<size_t>(3 * i)];
    const Vec3d value = LabFromSrgb({p[0], p[1], p[2]});
    p[0] = static_cast<float>(value.x / 200);
    p[1] = static_cast<float>(value.y / 100);
    p[2] = static_cast<float>(value.z / 100);
  }
  return lab;
}

// [pixels, channels] at the size of the picture's small copy.
Eigen::MatrixXf NetworkRows(const OnnxNetwork& network, const Image& picture, int width,
                            int height) {
  const FeatureMap map = MapOf(Working(Colors(picture), 4 * kRegionSide, 8));
  const FeatureMap features = network.Run({{"image", &map}}, {"feat"})[0];
  Eigen::MatrixXf rows(int64_t{width} * height, features.channels);
  for (int c = 0; c < features.channels; ++c) {
    Image plane(features.width, features.height, 1);
    std::copy_n(features.plane(c), features.num_pixels(), plane.pixels.begin());
    const Image fitted = Resize(plane, width, height);
    rows.col(c) = Eigen::Map<const Eigen::VectorXf>(fitted.pixels.data(), rows.rows());
  }
  return rows;
}

}  // namespace

RegionFeatures::RegionFeatures(const std::string& network, const std::vector<Image>& examples) {
  REGRADE_CHECK(!examples.empty());
  if (network.empty()) return;
  network_ = std::make_unique<OnnxNetwork>(network);
  std::vector<Eigen::MatrixXf> parts;
  Eigen::Index count = 0, channels = 0;
  for (const Image& example : examples) {
    const Image small = SmallCopy(example);
    parts.push_back(NetworkRows(*network_, example, small.width, small.height));
    count += parts.back().rows();
    channels = parts.back().cols();
  }
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(channels);
  for (const Eigen::MatrixXf& part : parts)
    mean += part.cast<double>().colwise().sum().transpose() / static_cast<double>(count);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(channels, channels);
  for (const Eigen::MatrixXf& part : parts) {
    const Eigen::MatrixXd centred = part.cast<double>().rowwise() - mean.transpose();
    covariance.noalias() += centred.transpose() * centred / static_cast<double>(count);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(covariance);
  REGRADE_CHECK(solver.info() == Eigen::Success);
  const Eigen::Index kept = std::min<Eigen::Index>(kNetworkFeatures, channels);
  const double variance = solver.eigenvalues().tail(kept).sum();
  const double scale = variance > 0 ? std::sqrt(kNetworkVariance / variance) : 0;
  mean_.resize(static_cast<size_t>(channels));
  directions_.assign(static_cast<size_t>(kNetworkFeatures * channels), 0.0f);
  for (Eigen::Index c = 0; c < channels; ++c) {
    mean_[static_cast<size_t>(c)] = static_cast<float>(mean[c]);
    for (Eigen::Index k = 0; k < kept; ++k)
      directions_[static_cast<size_t>(k * channels + c)] =
          static_cast<float>(scale * solver.eigenvectors()(c, channels - 1 - k));
  }
}

RegionFeatures::~RegionFeatures() = default;

PictureFeatures RegionFeatures::Of(const Image& picture) const {
  const Image small = SmallCopy(picture), lab = LabOf(small);
  const Image near = GaussianBlur(lab, 1);
  const Image around = GaussianBlur(lab, kRegionSide / 16.0);
  PictureFeatures features{small.width, small.height, {}};
  FeatureRows& rows = features.rows;
  rows.dimensions = kColors + 1 + (network_ ? kNetworkFeatures : 0);
  rows.values.resize(static_cast<size_t>(rows.dimensions * small.num_pixels()));
  Eigen::MatrixXf seen;
  if (network_) {
    seen = NetworkRows(*network_, picture, small.width, small.height);
    if (seen.cols() != std::ssize(mean_))
      throw ProgramError("gives another number of features for another picture",
                         network_->path(), "give a network of a fixed number of channels");
    seen.rowwise() -= Eigen::Map<const Eigen::RowVectorXf>(mean_.data(), seen.cols());
  }
  for (int64_t i = 0; i < small.num_pixels(); ++i) {
    float* const row = &rows.values[static_cast<size_t>(i * rows.dimensions)];
    for (int c = 0; c < 3; ++c) {
      row[c] = near.pixels[static_cast<size_t>(3 * i + c)];
      row[3 + c] = around.pixels[static_cast<size_t>(3 * i + c)] / 2;
    }
    const double above = 1 - (static_cast<double>(i / small.width) + 0.5) / small.height;
    row[kColors] = static_cast<float>(above / 5);
    for (int k = 0; network_ && k < kNetworkFeatures; ++k)
      row[kColors + 1 + k] = seen.row(i).dot(Eigen::Map<const Eigen::RowVectorXf>(
          &directions_[static_cast<size_t>(k * seen.cols())], seen.cols()));
  }
  return features;
}

}  // namespace regrade
