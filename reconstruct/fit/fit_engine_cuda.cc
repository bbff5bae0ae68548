// Fit steps on a CUDA device, which holds photos, field, gradients and moments; the host only
// launches. Float sums have no fixed order, so two runs differ in the last bits unless
// exact_sums is set.
#include <algorithm>
#include <optional>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/base/random_streams.h"
#include "kernels/field/cuda/device_rays.h"
#include "kernels/field/cuda/device_sphere_rays.h"
#include "kernels/field/cuda/device_views.h"
#include "reconstruct/fit/fit_engine.h"
#include "reconstruct/fit/resample_grid.h"
#include "reconstruct/fit/sphere_grid.h"

namespace regrade {
namespace {

constexpr int64_t kSampleStoreBytes = int64_t{1} << 30;

class CudaFitEngine : public FitEngine {
 public:
  CudaFitEngine(const TrainingRays* rays, uint64_t seed, bool exact_sums)
      : seed_(seed), exact_sums_(exact_sums), views_(rays->ToDevice()) {}

  void SetState(FitState state) override {
    grid_ = UploadGrid(state.grid, true, state.second_moment, exact_sums_, state.sphere_moment);
    Renew();
  }
  void ReadState(const std::function<void(FitState*)>& read) override {
    FitState state = Download();
    read(&state);
  }
  void EditState(const std::function<void(FitState*)>& edit) override {
    FitState state = Download();
    edit(&state);
    SetState(std::move(state));
  }
  void EndSteps() override {
    DropFitter();
    ended_ = true;
  }
  int64_t num_voxels() const override { return grid_.num_voxels(); }
  Vec3i resolution() const override { return grid_.frame.resolution; }

  void Step(const FitStep& step) override {
    const DeviceRange range("step of a fit");
    if (!fitter_ || march_.step != step.march.step ||
        march_.stop_transmittance != step.march.stop_transmittance) {
      march_ = step.march;
      fitter_.emplace(grid_.frame, march_, kSampleStoreBytes);
    }
    Reserve(step.rays);
    views_.Draw(seed_, step.number, step.rays, rays_.data(), targets_.data());
    fitter_->Accumulate(
        grid_, rays_.data(), targets_.data(), step.rays,
        1.0f / (3.0f * static_cast<float>(step.rays)), &touched_,
        {step.losses.beta / static_cast<float>(step.rays), step.losses.sparsity});
    // The sampling run of total variation is over stored voxels (see FitStep): each is chosen
    // with probability tv_fraction, so the expectation equals the CPU's.
    const int64_t voxels = grid_.num_voxels();
    const int64_t run = static_cast<int64_t>(step.tv_fraction * static_cast<float>(voxels));
    if (run > 0) {
      const int64_t begin = static_cast<int64_t>(RandomIndex(
          seed_ ^ kRandomTotalVariation, step.number, 0, static_cast<uint64_t>(voxels)));
      const float scale =
          1.0f / (step.tv_fraction * static_cast<float>(grid_.frame.NumVertices()));
      AddTotalVariation(grid_, begin, run, step.tv_density * scale, step.tv_sh * scale,
                        &touched_);
    }
    StepOnDevice(&grid_, &touched_, step.optimizer, fitter_->sums());
    if (grid_.spheres.on()) StepLayers(step);
  }

  FitSums TakeSums() override {
    KeepSums();
    return std::exchange(sums_, {});
  }

  RenderedView Render(const Camera& camera, const MarchOptions& march) override {
    return RenderViewOnDevice(grid_, camera, march);
  }

  void Refine(const MarchOptions& march, const PruneLimits& limits, const Vec3i& resolution,
              int sphere_resolution) override {
    const DeviceRange range("pruning and resampling");
    DropFitter();
    const DeviceBuffer<float> weights = limits.by_density ? Densities() : MaxWeights(march);
    const float threshold =
        limits.max_voxels == 0
            ? limits.least
            : BoundedLimit(weights.ToHost(), limits.least, limits.max_voxels);
    DeviceGrid next = ResampleOnDevice(grid_, weights, threshold, resolution);
    if (next.num_voxels() == 0)
      throw Error(ExitCode::kScene,
                  std::string("no voxel of the scene is left: none has a ") +
                      (limits.by_density ? "density" : "rendering weight") + " above " +
                      std::to_string(threshold),
                  "reconstruct", "check the poses, or lower prune-weight by --config");
    next.spheres = Resampled(std::move(grid_.spheres), sphere_resolution);
    grid_ = std::move(next);
    Renew();
  }

 private:
  DeviceBuffer<float> MaxWeights(const MarchOptions& march) {
    DeviceBuffer<float> weights(grid_.num_voxels(), "weights of voxels");
    weights.Zero();
    constexpr int kStride = 2;  // every other row and column of a view
    for (int view = 0; view < views_.num_views(); ++view) {
      Reserve(views_.RaysOf(view, kStride, nullptr));
      const int64_t n = views_.RaysOf(view, kStride, rays_.data());
      MaxWeightsOnDevice(grid_, rays_.data(), n, march, weights.data());
    }
    return weights;
  }

  // Through the host: three times per fit, a second each.
  DeviceBuffer<float> Densities() const {
    const auto dense = grid_.dense_density.ToHost();
    const auto vertex = grid_.vertex_of_voxel.ToHost();
    Buffer<float> densities(grid_.num_voxels());
    for (int64_t v = 0; v < densities.size(); ++v) densities[v] = dense[vertex[v]];
    return DeviceBuffer<float>::Of(densities, "densities of voxels");
  }

  FitState Download() const {
    FitState state{DownloadGrid(grid_), ended_ ? Buffer<float>() : DownloadSecondMoment(grid_),
                   0, 0};
    if (grid_.spheres.on()) state.sphere_moment = grid_.spheres.second_moment.ToHost();
    return state;
  }

  // A sampling run of the map's texel columns is regularised, as on the CPU.
  void StepLayers(const FitStep& step) {
    const DeviceSpheres& spheres = grid_.spheres;
    const int64_t map = spheres.links.size();
    const int64_t run = static_cast<int64_t>(step.tv_sphere_fraction * static_cast<float>(map));
    if (run > 0) {
      const int64_t begin = static_cast<int64_t>(RandomIndex(
          seed_ ^ kRandomSphereVariation, step.number, 0, static_cast<uint64_t>(map)));
      const float scale = 1.0f / (static_cast<float>(run) * static_cast<float>(spheres.layers));
      AddSphereVariation(grid_, begin, run, step.tv_sphere_density * scale,
                         step.tv_sphere_color * scale, &touched_);
    }
    StepSpheresOnDevice(&grid_, &touched_, step.optimizer, fitter_->sums());
  }

  // On the host: three times per fit, a fraction of a second each.
  DeviceSpheres Resampled(DeviceSpheres spheres, int resolution) const {
    if (!spheres.on()) return spheres;
    FastSpheres host = DownloadSpheres(spheres);
    spheres = {};
    if (resolution != host.resolution) host = ResampleSpheres(host, resolution);
    return UploadSpheres(host, true, {}, exact_sums_);
  }

  void KeepSums() {
    if (!fitter_) return;
    const DeviceFitSums sums = fitter_->TakeSums();
    DeviceWait("a step of the fit");
    sums_.squared_error += sums.squared_error;
    sums_.samples += static_cast<int64_t>(sums.samples);
    sums_.rejected_voxels += static_cast<int64_t>(sums.rejected_voxels);
  }

  // Before a new field is made, and what it needs is measured: the samples of rays would lie
  // beside both.
  void DropFitter() {
    KeepSums();
    fitter_.reset();
  }
  // Renews all buffers that depend on the grid.
  void Renew() {
    DropFitter();
    touched_ = DeviceTouched(grid_);
  }
  void Reserve(int64_t rays) {
    if (rays <= rays_.size()) return;
    rays_ = DeviceBuffer<Ray>(rays, "rays");
    targets_ = DeviceBuffer<Vec3f>(rays, "colours of rays");
  }

  uint64_t seed_;
  bool exact_sums_;
  bool ended_ = false;  // no step follows, and nobody reads moments
  DeviceViews views_;
  DeviceGrid grid_;
  DeviceTouched touched_;
  MarchOptions march_;
  std::optional<DeviceRayFitter> fitter_;
  FitSums sums_;  // of previous fitters
  DeviceBuffer<Ray> rays_;
  DeviceBuffer<Vec3f> targets_;
};

}  // namespace

std::unique_ptr<FitEngine> MakeCudaFitEngine(const TrainingRays* rays, uint64_t seed,
                                             bool exact_sums) {
  const DeviceStatus device = ReadDeviceStatus();
  if (!device.found) throw Error(ExitCode::kResources, device.name, "GPU", "use --device cpu");
  return std::make_unique<CudaFitEngine>(rays, seed, exact_sums);
}

}  // namespace regrade
