#include "pipeline/study/variant_runner.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <optional>

#include "evaluate/image_quality.h"
#include "evaluate/pair_motion.h"
#include "evaluate/pair_network.h"
#include "kernels/base/error.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/render.h"
#include "kernels/render/field_renderer.h"
#include "kernels/scene/common_camera.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/measured_depths.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/program/cpu_time.h"
#include "pipeline/run/fit_kind.h"
#include "pipeline/run/profile_run.h"
#include "pipeline/stages/make_stylizer.h"
#include "pipeline/stages/photo_metrics.h"
#include "pipeline/stages/stages.h"
#include "pipeline/stages/styled_field.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr int kStyledViews = 6;  // for the accuracy of a style
constexpr int kFrames = 8;       // rendered for the benchmarks of flow and of rendering
constexpr int kRenderedFrames = 3;

// Measures wall-clock and CPU time.
class Clocks {
 public:
  explicit Clocks(Measurement* measurement) : measurement_(measurement) {}
  void Stop(double count = 1) {
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - begin_;
    measurement_->seconds = wall.count() / count;
    measurement_->cpu_seconds = (CpuSeconds() - cpu_begin_) / count;
  }

 private:
  Measurement* measurement_;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  double cpu_begin_ = CpuSeconds();
};

// A run in a separate folder with the base's options and the variant's.
struct Trial {
  RunContext context;
  Workspace workspace;

  Trial(const RunContext& base, const Variant& variant, const std::string& folder)
      : workspace(folder) {
    context.settings.Bind(&context.options);
    context.options.ApplyConfig(base.options.Values(), "tradeoff");
    context.options.ApplyConfig(variant.options, "tradeoff");
    context.settings.run.out = folder;
    context.source = base.source;
    context.workspace = context.style = &workspace;  // one folder for both
    context.console = base.console;
  }

  // Links a file or folder of the base, or copies it if the disk has no hard links.
  void Link(const Workspace& base, const std::string& relative) {
    const fs::path from = base.Path(relative), to = workspace.NewPath(relative);
    std::error_code error;
    fs::copy(from, to, fs::copy_options::recursive | fs::copy_options::create_hard_links,
             error);
    if (!error) return;
    fs::remove_all(to);
    fs::copy(from, to, fs::copy_options::recursive);
  }
  void LinkRecord(const RunContext& base, const std::string& stage) {
    Link(base.FolderOf(stage), ".regrade/stages/" + stage + ".json");
  }
};

double NumberOf(const JsonValue& metrics, const char* name) {
  const JsonValue* value = metrics.Find(name);
  return value != nullptr && value->IsNumber() ? value->AsDouble() : std::nan("");
}

double Mean(const std::vector<double>& values) {
  return values.empty() ? std::nan("")
                        : std::accumulate(values.begin(), values.end(), 0.0) /
                              static_cast<double>(values.size());
}

// `count` evenly spaced elements of `all`.
std::vector<int> EvenlySpaced(const std::vector<int>& all, int count) {
  std::vector<int> some;
  const int n = static_cast<int>(all.size()), k = std::min(count, n);
  for (int i = 0; i < k; ++i)
    some.push_back(all[static_cast<size_t>((2 * i + 1) * n / (2 * k))]);
  return some;
}

}  // namespace

struct VariantRunner::Frames {
  StoredField stored;
  std::vector<Camera> cameras;
  std::vector<Image> colors;
  std::vector<FrameGeometry> geometry;
  std::vector<PairMotion> truth;  // from each frame to the next
};

VariantRunner::VariantRunner(RunContext* base, const std::string& folder)
    : base_(base), folder_(folder) {}
VariantRunner::~VariantRunner() = default;

Measurement VariantRunner::Measure(const Variant& variant, int repeat,
                                   const ProgressFunction& progress) {
  Measurement m;
  m.benchmark = variant.benchmark;
  m.parameter = variant.parameter;
  m.value = variant.value;
  m.repeat = repeat;
  fs::remove_all(folder_);  // results of an interrupted measurement would be reused
  if (variant.benchmark == "poses")
    MeasurePoses(variant, progress, &m);
  else if (variant.benchmark == "fit")
    MeasureFit(variant, progress, &m);
  else if (variant.benchmark == "style")
    MeasureStyle(variant, progress, &m);
  else if (variant.benchmark == "render")
    MeasureRender(variant, &m);
  else
    MeasureFlow(variant, &m);
  fs::remove_all(folder_);
  if (!std::isfinite(m.accuracy))
    throw Error(ExitCode::kScene, "there is nothing to measure accuracy with",
                variant.benchmark,
                variant.benchmark == "fit" ? "hold out photos: --holdout 8"
                                           : "leave its parameters out with --parameters");
  return m;
}

void VariantRunner::MeasurePoses(const Variant& variant, const ProgressFunction& progress,
                                 Measurement* m) {
  Trial trial(*base_, variant, folder_);
  const Stage stage = PoseStage(&trial.context);
  Clocks clocks(m);
  const StageOutcome outcome = stage.work(progress);
  clocks.Stop();
  m->accuracy = NumberOf(outcome.metrics, "reprojection_px");
  for (const char* name : {"registered", "points"}) m->work[name] = outcome.metrics.At(name);
}

// The photos of a fit at one working size. Read once, and not timed: reading is the same for
// all variants.
struct VariantRunner::Photos {
  WorkingViews working_views;
  NormalizedScene scene = {};
  std::vector<Image> pictures = {};
  std::vector<TrainingView> views = {};
  FitPlace place = {};  // on the CPU
};

const VariantRunner::Photos& VariantRunner::PhotosAt(int size) {
  if (photos_ != nullptr && photos_->working_views.photo_size() == size) return *photos_;
  photos_ = std::make_unique<Photos>(Photos{base_->Views().AtSize(size)});
  Photos& p = *photos_;
  p.scene = SceneOfRun(base_->settings, p.working_views.capture());
  p.working_views = p.working_views.InField(p.scene.field_from_world, p.scene.ndc);
  const std::vector<int> fitted = p.working_views.Training();
  p.pictures.reserve(fitted.size());
  std::vector<std::string> said_before;
  std::vector<std::vector<SeenPoint>> seen =
      PointsOfViews(p.working_views.capture(), fitted, p.scene.field_from_world, &said_before);
  for (size_t f = 0; f < fitted.size(); ++f) {
    const int i = fitted[f];
    Image picture = p.working_views.PhotoToFit(i);
    if (picture.empty()) continue;
    p.place.pixels += picture.num_pixels();
    p.pictures.push_back(std::move(picture));
    p.views.push_back({p.working_views.CameraOf(i), &p.pictures.back(), std::move(seen[f])});
  }
  p.place.photos = std::ssize(p.views);
  p.place.box = p.scene.box;
  return p;
}

void VariantRunner::MeasureFit(const Variant& variant, const ProgressFunction& progress,
                               Measurement* m) {
  RunSettings settings = base_->settings;
  OptionSet set;
  settings.Bind(&set);
  set.ApplyConfig(variant.options, "tradeoff");
  const Photos& photos = PhotosAt(settings.scene.photo_size);
  settings.run.seed += static_cast<uint64_t>(m->repeat);
  const std::unique_ptr<FieldFit> fit = FitKindOf(settings).make(settings, photos.place);
  fit->FitIntoMemory();
  // The degree chosen by the base's trial, unless it is the parameter.
  const auto record = base_->workspace->Find("reconstruct");
  if (record && !variant.parameter.ends_with("-degree"))
    fit->LimitDegree(static_cast<int>(record->metrics.At("sh_degree").AsInt()));
  FieldFitHooks hooks;
  hooks.progress = progress;
  Clocks clocks(m);
  FittedField fitted = fit->Run(photos.views, hooks);
  clocks.Stop();
  m->work["rays"] = fitted.rays;
  m->work["records"] = fitted.field.geometry->num_voxels();
  // Measured at the base's photo size for all variants, for comparable values.
  const StoredField stored{std::move(fitted.field), photos.scene.field_from_world,
                           photos.scene.ndc};
  const PhotoMetrics held_out =
      MeasureOnPhotos(photos.working_views.AtSize(base_->settings.scene.photo_size),
                      photos.working_views.HeldOut(), stored, Backend::kCpu,
                      PerceptualDistance(base_->settings.consistency.lpips));
  m->accuracy = MeanOf(held_out.psnr).value_or(std::nan(""));
  m->ssim = MeanOf(held_out.ssim);
  m->detail_kept = MeanOf(held_out.detail_kept);
  m->lpips = MeanOf(held_out.lpips);
}

void VariantRunner::MeasureStyle(const Variant& variant, const ProgressFunction& progress,
                                 Measurement* m) {
  Trial trial(*base_, variant, folder_);
  for (const char* path : {"poses", "field.npz"}) trial.Link(*base_->workspace, path);
  trial.Link(*base_->style, "views_2d");
  for (const char* stage : {"reconstruct", "style_2d"}) trial.LinkRecord(*base_, stage);
  trial.context.settings.run.seed += static_cast<uint64_t>(m->repeat);
  const Stage stage = StylizeStage(&trial.context);
  Clocks clocks(m);
  const StageOutcome outcome = stage.work(progress);
  clocks.Stop();
  for (const char* name : {"steps", "k_est", "bound"}) m->work[name] = outcome.metrics.At(name);

  const Workspace& base = *base_->style;
  const StoredField styled = ReadStyledField(trial.workspace.folder(), trial.workspace.folder(),
                                             base_->settings.style.strength);
  const WorkingViews views = base_->Views().InField(styled);
  const FieldRenderer renderer(styled.field, Backend::kCpu);
  const bool of_renders = fs::exists(base.Path("frames/views_2d"));
  std::vector<double> psnr;
  for (const int i : EvenlySpaced(StyledViews(base, views), kStyledViews)) {
    RenderedView view = renderer.Render(views.CameraOf(i));
    if (of_renders && base_->settings.render.keep_exposure) PutGain(views.Gain(i), &view.color);
    Image target = ReadImage(
        base.Path(std::string(of_renders ? "frames/views_2d/" : "views_2d/") + FrameName(i)));
    if (!of_renders) views.LeaveOutMasked(i, &target);
    if (const auto value = Psnr(view.color, target, &view.transmittance))
      psnr.push_back(*value);
  }
  m->accuracy = Mean(psnr);
}

const VariantRunner::Frames& VariantRunner::BaseFrames() {
  if (frames_ != nullptr) return *frames_;
  frames_ = std::make_unique<Frames>();
  Frames& f = *frames_;
  const Workspace& base = *base_->workspace;
  f.stored = ReadFieldFile(base.Path("field.npz"));
  const FieldRenderer renderer(f.stored.field, Backend::kCpu);
  const WorkingViews views = base_->Views().InField(f.stored);
  const int count = std::min(kFrames, views.count());
  // Flow is compared on frames of one size.
  const std::vector<Camera> cameras = WithCommonIntrinsics(views.Cameras());
  for (int i = 0; i < count; ++i) {
    const Camera& camera = cameras[static_cast<size_t>(i)];
    const RenderedView view = renderer.Render(camera);
    f.cameras.push_back(camera);
    f.colors.push_back(view.color);
    f.geometry.push_back({DepthAlongRays(camera, view.depth), camera});
  }
  const PairMotionFunction known =
      GeometricMotion([&f](int i) { return f.geometry[static_cast<size_t>(i)]; });
  for (int i = 0; i + 1 < count; ++i) f.truth.push_back(known(i, i + 1));
  return f;
}

void VariantRunner::MeasureRender(const Variant& variant, Measurement* m) {
  const Frames& f = BaseFrames();
  const FastGrid grid = MakeFastGrid(f.stored.field);
  MarchOptions march = f.stored.field.march;
  if (const JsonValue* stop = variant.options.Find("ray-stop"))
    march.stop_transmittance = static_cast<float>(stop->AsDouble());
  if (const JsonValue* step = variant.options.Find("ray-step"))
    march.step = static_cast<float>(step->AsDouble()) * f.stored.field.march.step;
  std::vector<Image> frames;
  Clocks clocks(m);
  for (size_t i = 0; i < std::min<size_t>(kRenderedFrames, f.cameras.size()); ++i)
    frames.push_back(RenderView(grid, f.cameras[i], march).color);
  clocks.Stop(static_cast<double>(frames.size()));
  // Beside rays that are marched to the end.
  const MarchOptions accurate{0.25f * f.stored.field.march.step, 0};
  std::vector<double> squared;
  for (size_t i = 0; i < frames.size(); ++i)
    if (const auto error =
            MeanSquaredError(frames[i], RenderView(grid, f.cameras[i], accurate).color))
      squared.push_back(*error);
  m->accuracy = 255 * std::sqrt(Mean(squared));
  m->work["pixels"] = frames.empty() ? int64_t{0} : frames[0].num_pixels();
}

void VariantRunner::MeasureFlow(const Variant& variant, Measurement* m) {
  const Frames& f = BaseFrames();
  std::string method = base_->settings.consistency.flow;
  if (const JsonValue* flow = variant.options.Find("flow")) method = flow->AsString();
  const FrameSource source{static_cast<int>(f.colors.size()),
                           [&f](int i) { return f.colors[static_cast<size_t>(i)]; }};
  const std::string mode =
      base_->settings.consistency.mode == "ruder2016" ? "ruder2016" : "lai2018";
  const PairMotionFunction motion = EstimatedMotion(source, mode, method);
  std::vector<PairMotion> estimated;
  Clocks clocks(m);
  for (size_t i = 0; i < f.truth.size(); ++i)
    estimated.push_back(motion(static_cast<int>(i), static_cast<int>(i) + 1));
  clocks.Stop(std::max<double>(1, static_cast<double>(f.truth.size())));
  // Over the pixels that are visible in the next frame.
  double sum = 0, pixels = 0;
  for (size_t i = 0; i < estimated.size(); ++i)
    for (int y = 0; y < estimated[i].flow.height; ++y)
      for (int x = 0; x < estimated[i].flow.width; ++x) {
        if (*f.truth[i].mask.weight.at(x, y) < 0.5f) continue;
        const float *a = estimated[i].flow.at(x, y), *b = f.truth[i].flow.at(x, y);
        const double error = std::hypot(a[0] - b[0], a[1] - b[1]);
        if (std::isfinite(error)) sum += error, ++pixels;
      }
  m->accuracy = pixels > 0 ? sum / pixels : std::nan("");
  m->work["pairs"] = static_cast<int64_t>(estimated.size());
}

}  // namespace regrade
