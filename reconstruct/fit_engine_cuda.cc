// Steps of a fit on a CUDA device: photos, field, gradients and moments live there; the host
// only says what comes next. Float sums in no fixed order, so two runs differ in the last bits
// unless sums are exact.
#include <algorithm>
#include <optional>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/field/device/device_rays.h"
#include "kernels/scene/device_views.h"
#include "reconstruct/fit_engine.h"

namespace regrade {
namespace {

constexpr int64_t kSampleStoreBytes = int64_t{1} << 30;

class CudaFitEngine : public FitEngine {
 public:
  CudaFitEngine(const TrainingRays* rays, uint64_t seed, bool exact_sums)
      : seed_(seed), exact_sums_(exact_sums), views_(rays->ToDevice()) {}

  void Take(FitState state) override {
    grid_ = UploadGrid(state.grid, true, state.second_moment, exact_sums_);
    Renew();
  }
  void Show(const std::function<void(FitState*)>& use) override {
    FitState state{DownloadGrid(grid_), DownloadSecondMoment(grid_), 0, 0};
    use(&state);
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
    fitter_->Accumulate(grid_, rays_.data(), targets_.data(), step.rays,
                        1.0f / (3.0f * static_cast<float>(step.rays)), &touched_);
    // The same expectation as the CPU's run of vertices: each stored voxel with the share's
    // probability.
    const int64_t voxels = grid_.num_voxels();
    const int64_t run = static_cast<int64_t>(step.tv_share * static_cast<float>(voxels));
    if (run > 0) {
      const int64_t begin = static_cast<int64_t>(
          RandomIndex(seed_ ^ 0x7476ull, step.number, 0, static_cast<uint64_t>(voxels)));
      const float scale =
          1.0f / (step.tv_share * static_cast<float>(grid_.frame.NumVertices()));
      AddTotalVariation(grid_, begin, run, step.tv_density * scale, step.tv_sh * scale,
                        &touched_);
    }
    StepOnDevice(&grid_, &touched_, step.optimizer, fitter_->sums());
  }

  FitSums TakeSums() override {
    if (!fitter_) return {};
    const DeviceFitSums sums = fitter_->TakeSums();
    DeviceWait("a step of the fit");
    return {sums.squared_error, static_cast<int64_t>(sums.samples),
            static_cast<int64_t>(sums.rejected_voxels)};
  }

  RenderedView Render(const Camera& camera, const MarchOptions& march) override {
    return RenderViewOnDevice(grid_, camera, march);
  }

  void Refine(const MarchOptions& march, float threshold, const Vec3i& resolution,
              int) override {
    const DeviceRange range("pruning and resampling");
    DeviceBuffer<float> weights(grid_.num_voxels(), "weights of voxels");
    weights.Zero();
    constexpr int kStride = 2;  // every other row and column of a view
    for (int view = 0; view < views_.num_views(); ++view) {
      Reserve(views_.RaysOf(view, kStride, nullptr));
      const int64_t n = views_.RaysOf(view, kStride, rays_.data());
      MaxWeightsOnDevice(grid_, rays_.data(), n, march, weights.data());
    }
    DeviceGrid next = ResampleOnDevice(grid_, weights, threshold, resolution);
    if (next.num_voxels() == 0)
      throw Error(ExitCode::kScene,
                  "nothing of the scene is left: no voxel weighs more than " +
                      std::to_string(threshold) + " in any view",
                  "reconstruct", "check the poses, or lower --prune-weight");
    grid_ = std::move(next);
    Renew();
  }

 private:
  // What belongs to the grid as it is now.
  void Renew() {
    fitter_.reset();
    touched_ = DeviceTouched(grid_);
  }
  void Reserve(int64_t rays) {
    if (rays <= rays_.size()) return;
    rays_ = DeviceBuffer<Ray>(rays, "rays");
    targets_ = DeviceBuffer<Vec3f>(rays, "colours of rays");
  }

  uint64_t seed_;
  bool exact_sums_;
  DeviceViews views_;
  DeviceGrid grid_;
  DeviceTouched touched_;
  MarchOptions march_;
  std::optional<DeviceRayFitter> fitter_;
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
