// The gradient of the style loss by way of the voxels that the rays touch.
//
// EQ(liprf-loss):  L_rec = 1 / (3 Q) sum over Q rays r and channels c of (C_r,c(f) -
// target_r,c)^2,
//   C_r = sum_i w_i max(0, Gamma(d_i) . s_i + 1/2) + T_r c_bg,   s_i = trilinear blend of
//   f(voxel), d_i the ray's direction; of splats s_i = f(splat), and d_i as in EQ(splat-color).
// Geometry is frozen, so w_i and T_r are constants. LipRF's Algorithm 1 sends every voxel
// through f; a voxel that no ray touches has gradient zero, so sending the touched ones alone
// gives the same gradient. The paper's text also allows 1 / B in place of 1 / (3 Q), B being
// the number of points that f maps: voxels and texels of the background.
//
// With view_weight > 0 the loss has a second term, see EQ(view-penalty), and so has the
// gradient.
//
// One-sided (the standard recipe): a colour at or above 1 whose target is 1, or at or below 0
// whose target is 0, is no error, because a picture clips it.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "kernels/base/buffer.h"
#include "kernels/field/radiance_field.h"
#include "kernels/field/ray_march.h"
#include "kernels/field/ray_weights.h"
#include "kernels/render/ray_weigher.h"
#include "kernels/scene/view_rays.h"
#include "stylize/field/lipschitz_network.h"

namespace regrade {

struct StyleRays : ViewRays {
  std::vector<Vec3f> targets;  // sRGB; a ray with a non-finite target is left out
};

struct AggregationOptions {
  MarchOptions march;
  float min_weight = 0;         // samples of less weight are dropped
  float max_transmittance = 1;  // rays that transmit more light are left out
  bool one_sided = false;
  double view_weight = 0;         // lambda_view of EQ(view-penalty)
  bool divide_by_voxels = false;  // 1 / B instead of 1 / (3 Q)
  bool every_voxel = false;       // through f at each step, as in Algorithm 1: same gradient
  int64_t batch = 1 << 20;        // points that pass f at a time, as in Algorithm 1
  bool exact_sums = false;        // on a device; the CPU's sums have a fixed order

  // Without `march`, which is the field's, and divide_by_voxels, see TrainNetworkOptions.
  template <typename Bind>
  void Describe(Bind& bind) {
    bind("style-min-weight", min_weight,
         {.help = "samples of less weight are dropped in training: faster, and off by at most "
                  "the sum of their weights",
          .min = 0,
          .max = 0.1,
          .constant = true});
    bind("style-max-transmittance", max_transmittance,
         {.help = "rays that transmit more light than this are left out of training; 1 keeps "
                  "all",
          .min = 0,
          .max = 1,
          .constant = true});
    bind("style-one-sided", one_sided,
         {.help = "a colour beyond 0 or 1 is no error where its target is 0 or 1: pictures "
                  "clip both",
          .constant = true});
    bind("style-view-weight", view_weight,
         {.help = "penalty on restyled colours that change with the viewing direction: 0 "
                  "follows a 2D method that maps each view differently, and flickers more; "
                  "larger values are more consistent and less faithful to the 2D method",
          .min = 0,
          .max = 1e6,
          .constant = true});
    bind("style-every-voxel", every_voxel,
         {.help = "sends every voxel through the network at each step, as the paper's "
                  "Algorithm 1, instead of those that the step's rays touch: same result, "
                  "slower; for timing",
          .constant = true});
    bind("style-batch", batch,
         {.unit = "voxels",
          .help = "how many pass the network at a time, as in the paper's Algorithm 1; more "
                  "take more memory, and no less time",
          .min = 1024,
          .max = 1e9,
          .constant = true});
    bind("style-exact-sums", exact_sums,
         {.help = "GPU: sums colours and gradients as integers, so that two trainings on the "
                  "same card are bitwise equal; slower, and more memory",
          .constant = true});
  }
};

struct AggregationResult {
  double loss = 0;           // see EQ(liprf-loss); with a gradient see EQ(view-penalty), too
  double squared_error = 0;  // sum over rays and channels, colours clipped to [0, 1]
  int64_t rays = 0;          // that count
  int64_t touched_voxels = 0;
  int64_t samples = 0;

  double Mse() const {
    return rays > 0 ? squared_error / (3.0 * static_cast<double>(rays)) : 0;
  }
};

// Loss and gradient of a training step, on the CPU or a device.
class StyleLoss {
 public:
  virtual ~StyleLoss() = default;

  // Adds the gradient of L_rec to `gradient` [network.NumParameters()] unless it is
  // null. Rays are taken in bands and f's input in batches, so memory grows with the touched
  // voxels' colours and their gradients only.
  virtual AggregationResult Run(const LipschitzNetwork& network, const StyleRays& batch,
                                std::vector<double>* gradient) = 0;

  // Along each ray that counts, sum_i w_i h(x_i) [rays, kMlpHidden] of the last hidden layer h,
  // and what is missing to the target [rays, 3]: the last layer's weights enter a ray's colour
  // linearly but for the clamp. `opacity` [rays] is 1 - T.
  struct HiddenSums {
    std::vector<float> hidden, missing, opacity;
  };
  virtual HiddenSums SumHidden(const LipschitzNetwork& network, const StyleRays& batch) = 0;
};

// `network` cut off behind its last hidden layer: as many of that layer's units as a row has
// floats, from `first` on, are its outputs.
DenseNetwork<float> HiddenUnits(const LipschitzNetwork& network, int first);

// On the CPU. Results do not depend on the number of threads.
class GradientAggregation : public StyleLoss {
 public:
  GradientAggregation(const RadianceField& field, const AggregationOptions& options);

  AggregationResult Run(const LipschitzNetwork& network, const StyleRays& batch,
                        std::vector<double>* gradient) override;
  HiddenSums SumHidden(const LipschitzNetwork& network, const StyleRays& batch) override;
  RayWeigher* weigher() { return weigher_.get(); }

 private:
  struct Band;

  void March(const StyleRays& batch, int64_t begin, int64_t end, Band* band);
  void FillTouchedFeatures(float position_scale, int64_t begin, int64_t count);
  // body(first slot, slots), one after the other, with features_ of these.
  template <typename Body>
  void ForEachBatch(float position_scale, const Body& body);
  void RenderColors(const StyleRays& batch, Band* band) const;
  void Scatter(const StyleRays& batch, const Band& band);
  // Behind Scatter, of a batch: EQ(view-penalty) times 3 Q. Adds its gradient, and clears the
  // masses.
  double AddViewPenalty(const LipschitzNetworkData& data, int64_t begin, int64_t count);
  bool Counts(const StyleRays& batch, const Band& band, int64_t ray) const;
  void ForgetTouched();

  void Touch(Band* band);
  void TouchAll();

  const RadianceField& field_;
  AggregationOptions options_;
  std::unique_ptr<RayWeigher> weigher_;
  int corners_;  // points that a sample may blend
  NetworkRow row_;
  std::vector<int32_t> vertex_of_voxel_, place_of_column_;
  // Of points, see CornerPoints: voxels, and then the texels of background spheres.
  std::vector<int32_t> slot_of_point_;  // -1 between runs
  std::vector<int32_t> touched_;        // point of slot
  Buffer<float> sh_, d_sh_;             // [slots, row_.stride()]
  Buffer<float> features_;              // [slots of a batch, row_.stride()]
};

}  // namespace regrade
