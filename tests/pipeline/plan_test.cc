#include "pipeline/run/plan.h"

#include <gtest/gtest.h>

#include "pipeline/run/fit_kind.h"
#include "pipeline/run/stage_estimate.h"
#include "tests/support/expect_error.h"

namespace regrade {
namespace {

const SceneBox kCube;
constexpr uint64_t kProgram = static_cast<uint64_t>(kProgramBytes);

FitOptions Fit(const std::vector<int>& resolutions, const std::vector<int>& steps) {
  return {.resolutions = resolutions, .steps = steps, .rays_per_step = 10500};
}

TEST(Plan, MemoryOfOneStageByHand) {
  // 100^3 vertices, all stored: values, moments, gradients and the pruned copy of 128 B,
  // vertex, slot, two arenas and two threads' weights of 4 B; two dense grids of 12 B. 1000
  // pixels of 18 B.
  const StagePlan plan = PlanFit(Fit({100}, {10}), 1000, kCube, 2);
  EXPECT_EQ(plan.memory, kProgram + 1000000u * (4 * 128 + 6 * 4 + 2 * 12) + 18000u);
}

TEST(Plan, LaterStagesStoreAFraction) {
  // 200^3 at two fifths outweighs 100^3 in full.
  const StagePlan plan = PlanFit(Fit({100, 200}, {10, 10}), 0, kCube, 2);
  EXPECT_EQ(plan.memory, kProgram + 3200000u * (4 * 128 + 6 * 4) + 8000000u * 2 * 12);
  // A coarse stage in full can be the peak: 0.4 * 110^3 < 100^3.
  EXPECT_EQ(PlanFit(Fit({100, 110}, {10, 10}), 0, kCube, 2).memory,
            PlanFit(Fit({100}, {10}), 0, kCube, 2).memory);
}

TEST(Plan, PruningRaisesItsLimitToTheMostVoxels) {
  FitOptions fit = Fit({100, 200}, {10, 10});
  EXPECT_NEAR(PlannedVoxels(fit, kCube, 0), 1e6, 1e-3);
  EXPECT_NEAR(PlannedVoxels(fit, kCube, 1), 3.2e6, 1e-3);
  fit.max_voxels = 2;
  EXPECT_NEAR(PlannedVoxels(fit, kCube, 0), 1e6, 1e-3);
  EXPECT_NEAR(PlannedVoxels(fit, kCube, 1), 2e6, 1e-3);
}

TEST(Plan, MemoryFollowsBoxDegreeAndThreads) {
  const FitOptions fit = Fit({64, 128}, {10, 10});
  const uint64_t cube = PlanFit(fit, 0, kCube, 2).memory - kProgram;
  const uint64_t flat = PlanFit(fit, 0, {.radius = {1, 1, 0.25f}}, 2).memory - kProgram;
  // Sides are rounded to whole voxels.
  EXPECT_NEAR(static_cast<double>(flat), 0.25 * static_cast<double>(cube), 0.02 * cube);
  EXPECT_GT(PlanFit(fit, 0, kCube, 16).memory - kProgram, cube);
  FitOptions plain = fit;
  plain.sh_degree = 0;  // records of 4 lanes instead of 32
  const double voxels = 0.4 * 128 * 128 * 128;
  EXPECT_NEAR(static_cast<double>(cube + kProgram - PlanFit(plain, 0, kCube, 2).memory),
              voxels * 4 * (128 - 16), 2);  // whole bytes
}

TEST(Plan, TimeFollowsRaysResolutionAndThreads) {
  // 1000 steps of 10500 rays are 10.5 M: 100 s of two threads at 160^3.
  EXPECT_NEAR(PlanFit(Fit({160}, {1000}), 0, kCube, 2).seconds, 100, 1e-9);
  EXPECT_NEAR(PlanFit(Fit({160}, {1000}), 0, kCube, 8).seconds, 25, 1e-9);
  EXPECT_NEAR(PlanFit(Fit({80, 320}, {1000, 1000}), 0, kCube, 2).seconds, 250, 1e-9);
  EXPECT_NEAR(PlanPoses(50, 2).seconds, 100, 1e-9);
  TrainNetworkOptions style;
  style.steps = 300;
  EXPECT_NEAR(PlanStyle(style, {}, 1e6, 0, 4).seconds, 11.25, 1e-9);
  style.rays_per_step = 0;  // whole views
  EXPECT_NEAR(PlanStyle(style, {}, 270 * 480, 0, 2).seconds, 353, 10);
}

// Measured on a card: whole views of fern at 1008x756 take 13.6 GiB with a field of 35.4 M
// voxels. A fifth of room: not all voxels are touched there, and links are narrower.
TEST(Plan, StyleHoldsTheFieldAndWhatItsRaysTouch) {
  TrainNetworkOptions style;
  ApplyStyleRecipe("paper", &style);
  const PlannedField field{35.4e6, 1408.0 * 1156 * 128, 9};
  const double whole = static_cast<double>(PlanStyle(style, field, 1008 * 756, 20, 2).memory);
  EXPECT_NEAR(whole / (13.6 * (1 << 30)), 1, 0.2);
  style.loss.batch = 1 << 30;
  EXPECT_NEAR(static_cast<double>(PlanStyle(style, field, 1008 * 756, 20, 2).memory) - whole,
              (35.4e6 - (1 << 20)) * 128, 1e3);
  style.rays_per_step = 4096;
  EXPECT_LT(static_cast<double>(PlanStyle(style, field, 1008 * 756, 20, 2).memory),
            0.6 * whole);
  EXPECT_EQ(PlanField(SplatFitOptions{.thousands = 100}).records, 1e5);
}

// Of 17 photos the first, the ninth and the last are held out.
TEST(Plan, ExpectedPixelsAreThoseThatAreFitted) {
  EXPECT_EQ(ExpectedPixels(17, 800, 8), 14 * 800 * 600);
  EXPECT_EQ(ExpectedPixels(17, 800, 0), 17 * 800 * 600);
  EXPECT_EQ(ExpectedPixels(1, 800, 8), 0);
}

TEST(StageEstimate, FollowsSizesAndTheMachinesPace) {
  RunSettings settings;
  const CaptureSize size{.photos = 50, .width = 1080, .height = 1920, .placed = true};
  const auto seconds = [&](const RunSettings& of, const CaptureSize& at, const char* stage) {
    return SecondsOf(EstimateStages(of, at, Backend::kCpu, 2), stage, stage);
  };
  const std::vector<StageEstimate> stages = EstimateStages(settings, size, Backend::kCpu, 2);
  ASSERT_EQ(stages.size(), 7u);
  double sum = 0;
  for (const StageEstimate& stage : stages) sum += stage.seconds;
  EXPECT_NEAR(SecondsOf(stages, "pose", "report"), sum, 1e-9);
  EXPECT_GT(stages[1].memory, 0u);
  // COLMAP takes longer than reading, a larger film longer, twice the threads half as long.
  CaptureSize unplaced = size;
  unplaced.placed = false;
  EXPECT_GT(seconds(settings, unplaced, "pose"), seconds(settings, size, "pose") + 10);
  RunSettings longer = settings;
  longer.render.film_seconds *= 2;
  EXPECT_GT(seconds(longer, size, "render"), 1.3 * seconds(settings, size, "render"));
  EXPECT_NEAR(SecondsOf(EstimateStages(settings, size, Backend::kCpu, 4), "render", "render"),
              0.5 * seconds(settings, size, "render"), 1e-9);
  // --max-memory is kept, by a coarser grid, which is fitted sooner.
  RunSettings limited = settings;
  limited.run.max_memory_gb = 1.5;
  const auto fit = [&](const RunSettings& of) {
    return EstimateStages(of, size, Backend::kCpu, 2).at(1);
  };
  EXPECT_GT(fit(settings).memory, 1'500'000'000u);
  EXPECT_LE(fit(limited).memory, 1'500'000'000u);
  EXPECT_LT(fit(limited).seconds, fit(settings).seconds);
  // A machine of half the speed, and one whose record is no measure.
  EXPECT_NEAR(MeasuredPace(stages, {{"reconstruct", 2 * stages[1].seconds}}), 2, 1e-9);
  EXPECT_EQ(MeasuredPace(stages, {{"reconstruct", 1e-3 * stages[1].seconds}}), 0.25);
  EXPECT_EQ(MeasuredPace(stages, {}), 1);
}

TEST(Plan, TooLittleMemoryIsAWarningThatNamesTheReason) {
  RunSettings settings;
  settings.fit = Fit({64, 128}, {10, 10});
  for (const char* field : {"voxels", "splats"}) {
    settings.scene.field = field;
    FitPlace place{.pixels = 1000000, .photos = 10, .max_memory_gb = 100};
    EXPECT_EQ(MemoryWarning(settings, place), "") << field;
    place.max_memory_gb = 0.001;
    EXPECT_NE(MemoryWarning(settings, place), "") << field;
  }
}

// 40 photos of 300 x 300 pixels, 100 thousand splats of 38 floats with two moments each.
TEST(Plan, SplatsAreLoweredToMemory) {
  SplatFitOptions asked;
  asked.thousands = 100, asked.sh_degree = 2, asked.steps = 100;
  const FitPlace place{.pixels = 3600000, .photos = 40};
  EXPECT_EQ(SplatsWithinMemory(asked, place).options.thousands, 100);
  const uint64_t memory = PlanSplatFit(asked, 3600000, 40, 2).memory;
  EXPECT_GT(memory, 100000u * 3 * 38 * 4);
  FitPlace less = place;
  less.max_memory_gb = 0.9e-9 * static_cast<double>(memory);
  const PlannedSplatFit lowered = SplatsWithinMemory(asked, less);
  EXPECT_LT(lowered.options.thousands, 100);
  EXPECT_LE(static_cast<double>(lowered.plan.memory), less.max_memory_gb * 1e9);
  EXPECT_NE(lowered.notice, "");
}

// Photos of a street that take more than a given memory are thinned, and never to fewer than
// a scene needs; without a limit all are kept.
TEST(Plan, PhotosAreThinnedToMemory) {
  SplatFitOptions options;
  options.thousands = 100, options.sh_degree = 2, options.steps = 100;
  const auto plan = [&options](const FitPlace& of) {
    return PlanSplatFit(options, of.pixels, of.photos, 2);
  };
  FitPlace place{.pixels = int64_t{4000} * 800 * 600, .photos = 4000};
  const double all = static_cast<double>(plan(place).memory);
  place.max_memory_gb = 2e-9 * all;
  EXPECT_EQ(OnePhotoIn(place, plan), 1);
  place.max_memory_gb = 0.5e-9 * all;
  const int64_t one_in = OnePhotoIn(place, plan);
  EXPECT_EQ(one_in, 3);
  FitPlace thinned = place;
  thinned.pixels /= one_in, thinned.photos /= one_in;
  EXPECT_LT(static_cast<double>(plan(thinned).memory), place.max_memory_gb * 1e9);
  place.max_memory_gb = 1e-9;
  EXPECT_EQ(OnePhotoIn(place, plan), 200);
  place.max_memory_gb = 0;
  EXPECT_EQ(OnePhotoIn(place, plan), 1);
}

// A splat for each 15 pixels is enough.
TEST(Plan, FewPixelsHaveFewSplats) {
  SplatFitOptions asked{.thousands = 100};
  EXPECT_EQ(SplatsWithinMemory(asked, {.pixels = 600000, .photos = 4}).options.thousands, 40);
}

TEST(Plan, DeviceMemoryByHand) {
  // 100^3 vertices, all stored: three records of 128 B and an index; link, density, two
  // distances; 1 GiB of samples.
  const StagePlan one = PlanFitOnDevice(Fit({100}, {10}), 1000, kCube);
  EXPECT_EQ(one.memory, 1000000u * (3 * 128 + 4 + 10) + 6000u + (1u << 30));
  FitOptions exact = Fit({100}, {10});
  exact.exact_sums = true;  // a million voxels of 32 floats more, and slower
  EXPECT_NEAR(static_cast<double>(PlanFitOnDevice(exact, 1000, kCube).memory - one.memory),
              128e6, 1e6);
  EXPECT_GT(PlanFitOnDevice(exact, 1000, kCube).seconds, one.seconds);
  // The coarser grid and its weights stay until the finer one, two fifths of it stored, is
  // there.
  const StagePlan two = PlanFitOnDevice(Fit({100, 200}, {10, 10}), 0, kCube);
  EXPECT_EQ(two.memory, 1000000u * (3 * 128 + 4 + 10 + 4) + 3200000u * (3 * 128 + 4) +
                            8000000u * 10 + (1u << 30));
}

TEST(Plan, TooLittleMemoryNamesWhatToLower) {
  const StagePlan plan{2000000000, 252};
  EXPECT_EQ(PlanText(plan), "about 2.0 GB of memory and 4 min 12 s");
  EXPECT_EQ(PlanText({18000000, 5}), "about 18 MB of memory and 5 s");
  EXPECT_EQ(PlannedMemory(1.5, 99), 1500000000u);
  EXPECT_EQ(PlannedMemory(0, 99), 99u);
  EXPECT_NO_THROW(CheckFitsMemory(plan, 2000000000));
  EXPECT_NO_THROW(CheckFitsMemory(plan, 0));  // not known
  EXPECT_REGRADE_ERROR(CheckFitsMemory(plan, 1999999999), ExitCode::kResources, "2.0 GB");
  EXPECT_REGRADE_ERROR(CheckFitsMemory(plan, 1999999999, "GPU memory"), ExitCode::kResources,
                       "GPU memory");
  EXPECT_REGRADE_ERROR(CheckFitsMemory(plan, 1), ExitCode::kResources, "--preset draft");
}

// Before a run fails its finest grids become coarser, no further than they must, and what was
// coarse already stays.
TEST(Plan, ResolutionsAreLoweredToMemory) {
  const auto plan_of = [](const FitOptions& options) { return PlanFit(options, 0, kCube, 2); };
  const FitOptions asked = Fit({64, 128, 320}, {10, 10, 10});
  FitOptions options = asked;
  EXPECT_FALSE(LowerToMemory(plan_of, plan_of(asked).memory, &options));
  EXPECT_FALSE(LowerToMemory(plan_of, 0, &options));  // not known
  EXPECT_EQ(options.resolutions, asked.resolutions);
  const uint64_t half = plan_of(asked).memory / 2;
  EXPECT_TRUE(LowerToMemory(plan_of, half, &options));
  EXPECT_EQ(options.resolutions[0], 64);
  EXPECT_EQ(options.resolutions[1], 128);
  EXPECT_LE(plan_of(options).memory, half);
  // Steps of a sixteenth of the side are a sixth of the memory.
  EXPECT_GT(static_cast<double>(plan_of(options).memory), 0.8 * static_cast<double>(half));
  EXPECT_TRUE(LowerToMemory(plan_of, 1, &options));  // in vain: CheckFitsMemory then says so
  EXPECT_EQ(options.resolutions, (std::vector<int>{64, 64, 64}));
  EXPECT_FALSE(LowerToMemory(plan_of, 1, &options));
}

// What was lowered is said; a reproducible fit is lowered to a given limit only.
TEST(Plan, AFitIsLoweredToItsLimit) {
  const FitOptions asked = Fit({16, 96}, {10, 10});
  const double gigabytes = 0.7e-9 * static_cast<double>(PlanFitAt({}, asked).memory);
  const PlannedFit fit = FitWithinMemory(asked, {.max_memory_gb = gigabytes});
  EXPECT_LT(fit.options.resolutions[1], 96);
  EXPECT_EQ(fit.notice, Concat("the finest grid has ", fit.options.resolutions[1],
                               " voxels a side instead of 96 to fit into --max-memory"));
  EXPECT_EQ(fit.plan.memory, PlanFitAt({}, fit.options).memory);
  const PlannedFit unlimited = FitWithinMemory(asked, {.reproducible = true});
  EXPECT_EQ(unlimited.options.resolutions, asked.resolutions);
  EXPECT_EQ(unlimited.notice, "");
  EXPECT_LT(FitWithinMemory(asked, {.max_memory_gb = gigabytes, .reproducible = true})
                .options.resolutions[1],
            96);
  EXPECT_REGRADE_ERROR(FitWithinMemory(asked, {.max_memory_gb = 0.01}), ExitCode::kResources,
                       "of memory");
}

}  // namespace
}  // namespace regrade
