#include "stylize/image/regrain.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"

namespace regrade {
namespace {

constexpr int kSmallestSide = 20;    // pixels of the picture that the solution begins with
constexpr double kTolerance = 1e-3;  // of the residual, against the right side's
constexpr int kMostIterations = 200;

// One size's equations, for all three channels: (D(psi) + L(phi)) J = psi T + L(phi) I.
class Equations {
 public:
  Equations(const Image& picture, const Image& transferred)
      : width_(picture.width), height_(picture.height) {
    const size_t n = static_cast<size_t>(picture.num_pixels());
    psi_.resize(n);
    std::vector<float> phi(n);
    for (int y = 0; y < height_; ++y)
      for (int x = 0; x < width_; ++x) {
        const float dx = Mean(picture, x + 1, y) - Mean(picture, x, y),
                    dy = Mean(picture, x, y + 1) - Mean(picture, x, y);
        const float g = std::sqrt(dx * dx + dy * dy);
        psi_[At(x, y)] = std::clamp(256.0f / 5 * g, kLeastFaith, 1.0f);
        phi[At(x, y)] = 30 / (1 + 10 * g);
      }
    right_.resize(n), below_.resize(n);
    for (int y = 0; y < height_; ++y)
      for (int x = 0; x < width_; ++x) {
        right_[At(x, y)] = x + 1 < width_ ? (phi[At(x, y)] + phi[At(x + 1, y)]) / 2 : 0;
        below_[At(x, y)] = y + 1 < height_ ? (phi[At(x, y)] + phi[At(x, y + 1)]) / 2 : 0;
      }
    wanted_ = Smooth(picture);
    for (size_t i = 0; i < n; ++i)
      for (size_t c = 0; c < 3; ++c)
        wanted_.pixels[3 * i + c] += psi_[i] * transferred.pixels[3 * i + c];
  }

  // Conjugate gradients with a diagonal preconditioner, from `guess`.
  Image Solve(Image guess) const {
    Image residual = Apply(guess);
    const size_t n = guess.pixels.size();
    for (size_t i = 0; i < n; ++i) residual.pixels[i] = wanted_.pixels[i] - residual.pixels[i];
    const double target = kTolerance * kTolerance * Dot(wanted_, wanted_);
    Image scaled = Scaled(residual), direction = scaled;
    double rho = Dot(residual, scaled);
    for (int k = 0; k < kMostIterations && Dot(residual, residual) > target; ++k) {
      const Image image = Apply(direction);
      const double curvature = Dot(direction, image);
      if (!(curvature > 0)) break;
      const float step = static_cast<float>(rho / curvature);
      for (size_t i = 0; i < n; ++i) {
        guess.pixels[i] += step * direction.pixels[i];
        residual.pixels[i] -= step * image.pixels[i];
      }
      scaled = Scaled(residual);
      const double next = Dot(residual, scaled);
      const float turn = static_cast<float>(next / rho);
      rho = next;
      for (size_t i = 0; i < n; ++i)
        direction.pixels[i] = scaled.pixels[i] + turn * direction.pixels[i];
    }
    return guess;
  }

 private:
  size_t At(int x, int y) const { return static_cast<size_t>(y) * width_ + x; }
  float Mean(const Image& image, int x, int y) const {
    const float* p = image.at(std::min(x, width_ - 1), std::min(y, height_ - 1));
    return (p[0] + p[1] + p[2]) / 3;
  }

  // L(phi) J: what a pixel differs from its neighbours by, weighted.
  Image Smooth(const Image& image) const {
    Image result(width_, height_);
#pragma omp parallel for schedule(static)
    for (int y = 0; y < height_; ++y)
      for (int x = 0; x < width_; ++x)
        for (int c = 0; c < 3; ++c) {
          const float here = image.at(x, y)[c];
          float sum = 0;
          if (x + 1 < width_) sum += right_[At(x, y)] * (here - image.at(x + 1, y)[c]);
          if (x > 0) sum += right_[At(x - 1, y)] * (here - image.at(x - 1, y)[c]);
          if (y + 1 < height_) sum += below_[At(x, y)] * (here - image.at(x, y + 1)[c]);
          if (y > 0) sum += below_[At(x, y - 1)] * (here - image.at(x, y - 1)[c]);
          result.at(x, y)[c] = sum;
        }
    return result;
  }
  Image Apply(const Image& image) const {
    Image result = Smooth(image);
    for (size_t i = 0; i < psi_.size(); ++i)
      for (size_t c = 0; c < 3; ++c)
        result.pixels[3 * i + c] += psi_[i] * image.pixels[3 * i + c];
    return result;
  }
  Image Scaled(const Image& residual) const {
    Image result = residual;
    for (int y = 0; y < height_; ++y)
      for (int x = 0; x < width_; ++x) {
        const float diagonal = psi_[At(x, y)] + right_[At(x, y)] + below_[At(x, y)] +
                               (x > 0 ? right_[At(x - 1, y)] : 0) +
                               (y > 0 ? below_[At(x, y - 1)] : 0);
        for (int c = 0; c < 3; ++c) result.at(x, y)[c] /= diagonal;
      }
    return result;
  }
  static double Dot(const Image& a, const Image& b) {
    double sum = 0;
    for (size_t i = 0; i < a.pixels.size(); ++i)
      sum += static_cast<double>(a.pixels[i]) * static_cast<double>(b.pixels[i]);
    return sum;
  }

  int width_, height_;
  std::vector<float> psi_, right_, below_;  // phi of the pair to the right and below
  Image wanted_;
};

Image SolveFromSmall(const Image& picture, const Image& transferred) {
  Image guess = transferred;
  const int width = picture.width / 2, height = picture.height / 2;
  if (std::min(width, height) >= kSmallestSide)
    guess = Resize(
        SolveFromSmall(Resize(picture, width, height), Resize(transferred, width, height)),
        picture.width, picture.height);
  return Equations(picture, transferred).Solve(std::move(guess));
}

}  // namespace

Image Regrain(const Image& picture, const Image& transferred) {
  REGRADE_CHECK(picture.SameSize(transferred) && picture.channels == 3 &&
                transferred.channels == 3);
  return SolveFromSmall(picture, transferred);
}

}  // namespace regrade
