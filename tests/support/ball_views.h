// Twelve views of a coloured ball, and fits of them that are stopped or run on some threads.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/field/render.h"
#include "kernels/image/decibels.h"
#include "kernels/scene/facing.h"
#include "reconstruct/fit/fit_field.h"
#include "tests/support/pinhole.h"
#include "tests/support/small_field.h"
#include "tests/support/threads.h"

namespace regrade::testing {

// Twelve views of a coloured ball in a grid field, rendered by the reference renderer.
class FitField : public ::testing::Test {
 protected:
  void SetUp() override {
    truth_ = VoxelBall(0.6f, 60, [](const Vec3f& p, int c) {
      return 0.8f * std::sin(3.0f * p[c] + 2.0f * p[(c + 1) % 3] + static_cast<float>(c));
    });
    truth_.background = {0.2f, 0.4f, 0.6f};
    for (int i = 0; i < 12; ++i) {
      const double angle = 2 * M_PI * i / 12;
      const Vec3d center{2.6 * std::cos(angle), 2.6 * std::sin(angle),
                         0.7 * std::sin(2 * angle)};
      Camera camera = PinholeOf(48, 48, focal_);
      const Vec3d forward = Normalized(-center);
      camera.camera_from_world =
          Facing(center, forward, Normalized(Cross(forward, Vec3d{0, 0, 1})));
      cameras_.push_back(camera);
      photos_.push_back(RenderViewPlain(truth_, camera, {0.5f, 1e-4f}).color);
    }
    for (size_t i = 1; i < cameras_.size(); ++i) views_.push_back({cameras_[i], &photos_[i]});
    options_.resolutions = {12, 24};
    options_.steps = {60, 60};
    options_.rays_per_step = 1024;
    options_.sh_degree = 1;
    options_.shards = 3;
    options_.step = 0.5f;
  }

  double HeldOutPsnr(const RadianceField& field) const {
    return DecibelsBetween(RenderView(field, cameras_[0], {0.5f, 1e-4f}).color, photos_[0]);
  }

  FitResult Fit(const FitHooks& hooks = {}) const {
    return regrade::FitField(views_, box_, options_, hooks);
  }

  FitResult FitWithThreads(int n) const {
    const Threads threads(n);
    return Fit();
  }

  // The checkpoint of a fit that is stopped after `steps` steps.
  FitState StoppedFit(int steps) const {
    FitState saved;
    int done = 0;
    FitHooks hooks;
    hooks.checkpoint = [&](const FitState& state) { saved = state; };
    hooks.progress = [&](const Progress&) {
      return ++done == steps ? LoopControl::kStop : LoopControl::kContinue;
    };
    EXPECT_THROW(Fit(hooks), Interrupted);
    EXPECT_GT(saved.grid.num_voxels(), 0) << "nothing was saved";
    return saved;
  }

  // Continues from `saved`, which the fit empties.
  FitResult ResumedFit(FitState* saved) const {
    FitHooks hooks;
    hooks.resume = saved;
    return Fit(hooks);
  }

  // Links, densities and colours, also of background spheres.
  static bool SameBits(const RadianceField& a, const RadianceField& b) {
    const auto same = [](const auto& x, const auto& y) {
      return x.size() == y.size() &&
             (x.size() == 0 || std::memcmp(x.data(), y.data(),
                                           sizeof(x[0]) * static_cast<size_t>(x.size())) == 0);
    };
    return same(a.geometry->links, b.geometry->links) &&
           same(a.geometry->density, b.geometry->density) &&
           same(a.appearance.sh, b.appearance.sh) &&
           same(a.geometry->spheres.density, b.geometry->spheres.density) &&
           same(a.appearance.sphere_color, b.appearance.sphere_color);
  }

  RadianceField truth_;
  double focal_ = 60;  // pixels
  std::vector<Camera> cameras_;
  std::vector<Image> photos_;
  std::vector<TrainingView> views_;
  FitOptions options_;
  SceneBox box_;
};

}  // namespace regrade::testing
