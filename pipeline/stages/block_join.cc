#include "pipeline/stages/block_join.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/render/field_renderer.h"
#include "kernels/splats/splat_field.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/stages/fit_quality.h"
#include "pipeline/stages/photo_metrics.h"
#include "pipeline/workspace/metrics_json.h"
#include "pipeline/workspace/style_folders.h"

namespace regrade {
namespace {

struct Joined {
  Splats splats;
  std::vector<float> fit_pixels;  // of the blocks
  BlockRecord sums;
  std::set<std::string> devices;
};

// Of each block what no later one took over.
Joined ReadBlocks(const BlockFolder& folder, const BlockPlan& plan) {
  Joined joined;
  double squared = 0, weights = 0;
  std::set<int> fitted_again;
  for (const SpaceBlock& block : plan.blocks) fitted_again.insert(block.repeats);
  for (int block = 0; block < std::ssize(plan.blocks); ++block) {
    const BlockRecord record = *folder.Find(block);
    const StoredField stored = ReadFieldFile(folder.FieldPath(block));
    const SplatsView<float> splats = SplatsOf(stored.field);
    Splats kept(0, splats.basis);
    AppendSplats(
        splats, [&](int64_t i) { return OwnerOf(plan.blocks, splats.mean + 3 * i) == block; },
        &kept);
    // Blocks of few steps may have fewer harmonics.
    const int basis = std::max(kept.basis, joined.splats.basis);
    PadBasis(basis, &kept);
    PadBasis(basis, &joined.splats);
    AppendSplats(kept.view(), &joined.splats);
    joined.splats.background = splats.background;
    joined.fit_pixels.push_back(stored.field.geometry->splats.fit_pixel);
    joined.devices.insert(record.device);
    joined.sums.seconds += record.seconds;
    joined.sums.peak_memory_gb = std::max(joined.sums.peak_memory_gb, record.peak_memory_gb);
    joined.sums.pixels += record.pixels;
    joined.sums.rejected += record.rejected;
    if (!record.psnr_train_db.value || fitted_again.contains(block)) continue;
    const double weight = static_cast<double>(record.pixels);
    squared += weight * std::pow(10, -*record.psnr_train_db.value / 10);
    weights += weight;
  }
  joined.sums.psnr_train_db = -10 * std::log10(squared / weights);
  return joined;
}

// That of all blocks, or below 0.
float FitPixel(const std::vector<float>& of_blocks) {
  constexpr float kAlike = 1.05f;
  const auto [least, most] = std::ranges::minmax(of_blocks);
  return least > 0 && most <= kAlike * least ? std::sqrt(least * most) : -1.0f;
}

// Where blocks meet on a surface: at neighbouring pixels of about the same depth whose places
// two blocks own.
class SeamFinder {
 public:
  explicit SeamFinder(const BlockPlan& plan) : plan_(plan) {}

  // [H, W]: 1 within kSeamPixels of such a place.
  std::vector<uint8_t> Near(const Camera& camera, const Image& depth) const {
    const int width = depth.width, height = depth.height;
    const std::vector<int> owners = Owners(camera, depth);
    std::vector<uint8_t> near(owners.size());
    const auto meet = [&](int x, int y, int other_x, int other_y) {
      const size_t a = static_cast<size_t>(y * width + x),
                   b = static_cast<size_t>(other_y * width + other_x);
      if (owners[a] < 0 || owners[b] < 0 || owners[a] == owners[b]) return;
      const float near_one = std::min(depth.pixels[a], depth.pixels[b]);
      if (std::abs(depth.pixels[a] - depth.pixels[b]) > kSameSurface * near_one) return;
      for (int v = std::max(0, y - kSeamPixels); v < std::min(height, y + kSeamPixels + 1); ++v)
        for (int u = std::max(0, x - kSeamPixels); u < std::min(width, x + kSeamPixels + 1);
             ++u)
          near[static_cast<size_t>(v * width + u)] = 1;
    };
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        if (x + 1 < width) meet(x, y, x + 1, y);
        if (y + 1 < height) meet(x, y, x, y + 1);
      }
    return near;
  }

 private:
  static constexpr float kSameSurface = 0.05f;  // relative difference of depths

  // Of each pixel's place the block; -1 where there is no surface.
  std::vector<int> Owners(const Camera& camera, const Image& depth) const {
    const RigidTransform world_from_camera = camera.camera_from_world.Inverse();
    std::vector<int> owners(depth.pixels.size(), -1);
    for (int y = 0; y < depth.height; ++y)
      for (int x = 0; x < depth.width; ++x) {
        const float z = *depth.at(x, y);
        if (!(z > 0)) continue;
        const Vec3d ray = camera.CameraRay(x + 0.5, y + 0.5);
        const Vec3f place = (world_from_camera * (ray * (double{z} / ray.z))).Cast<float>();
        owners[static_cast<size_t>(y * depth.width + x)] = OwnerOf(plan_.blocks, &place.x);
      }
    return owners;
  }

  const BlockPlan& plan_;
};

// dB of held-out photos at seams and elsewhere, of all their pixels together.
std::pair<Metric, Metric> MeasureSeams(const WorkingViews& views, const StoredField& stored,
                                       const BlockPlan& plan, Backend backend) {
  const WorkingViews as_taken = views.AsTaken().InField(stored);
  const FieldRenderer renderer(stored.field, backend);
  const SeamFinder seams(plan);
  double squared[2] = {};
  int64_t values[2] = {};
  for (const int i : views.HeldOut()) {
    const Image photo = as_taken.PhotoToFit(i);
    if (photo.empty()) continue;
    const Camera camera = as_taken.CameraOf(i);
    RenderedView view = renderer.Render(camera);
    PutGain(views.Gain(i), &view.color);
    const std::vector<uint8_t> near = seams.Near(camera, view.depth);
    for (size_t v = 0; v < photo.pixels.size(); ++v) {
      const double difference = double{photo.pixels[v]} - double{view.color.pixels[v]};
      if (!std::isfinite(difference)) continue;
      squared[near[v / 3]] += difference * difference;
      ++values[near[v / 3]];
    }
  }
  const auto psnr = [&](int of) {
    return values[of] > 0
               ? Metric(-10 * std::log10(squared[of] / static_cast<double>(values[of])))
               : Metric::Undefined("no pixel of a held-out photo");
  };
  return {psnr(1), psnr(0)};
}

// They were made of the field before.
void ForgetStyles(const std::string& folder) {
  for (const std::string& name : StyleNames(folder)) {
    Workspace style(StyleFolder(folder, name));
    for (const char* stage : kStageNames)
      if (!IsOfScene(stage)) style.Forget(stage);
  }
}

}  // namespace

void JoinBlocks(RunContext* context, const BlockFolder& folder) {
  const RunSettings& settings = context->settings;
  Workspace& workspace = *context->workspace;
  Console* const console = context->console;
  if (const std::vector<int> missing = folder.Missing(); !missing.empty()) {
    const std::string others =
        std::ssize(missing) == folder.fits() ? folder.OtherSettings() : "";
    throw InputError(Concat(BlocksText(missing, folder.blocks(), " is missing", " are missing"),
                            others.empty() ? "" : "; ", others),
                     folder.path(),
                     "run `regrade refine DIR --part K/N` for each K; what is there is not "
                     "done again");
  }
  const StageRecord before = *workspace.Find("reconstruct");
  const Backend backend = ChooseBackend(settings.run.device, settings.run.reproducible);
  console->BeginStage("refine", "joining the blocks of the field");
  const WorkingViews views = context->Views();
  const StoredField coarse = ReadFieldFile(folder.Path("coarse.npz"));
  const BlockPlan plan = *folder.Plan();
  Joined joined = ReadBlocks(folder, plan);

  StageRecord record = before;
  ReconstructReport metrics = MetricsFromJson<ReconstructReport>(record.metrics);
  RefineReport refined;
  refined.settings = folder.settings();
  refined.blocks = folder.blocks();
  refined.seconds = joined.sums.seconds;
  refined.peak_memory_gb = joined.sums.peak_memory_gb;
  refined.psnr_before_db =
      Metric(MeanOf(MeasureOnPhotos(views, views.HeldOut(), coarse, backend).psnr),
             "no photo was held out");
  metrics.device = Join({joined.devices.begin(), joined.devices.end()}, ", ");
  metrics.splats = joined.splats.count();
  metrics.sh_degree = static_cast<int>(std::lround(std::sqrt(joined.splats.basis))) - 1;
  metrics.rays = joined.sums.pixels;
  metrics.rejected_voxels = joined.sums.rejected;
  metrics.psnr_train_db = joined.sums.psnr_train_db;
  metrics.psnr_at_steps.clear();
  {
    const StoredField field{FieldOfSplats(joined.splats, coarse.field.geometry->frame,
                                          coarse.field.near_clip, FitPixel(joined.fit_pixels)),
                            coarse.field_from_world, coarse.ndc};
    joined = {};
    WriteFieldFile(workspace.Path("field.npz"), field);
  }
  const StoredField stored = ReadFieldFile(workspace.Path("field.npz"));
  MeasureFit(views, stored, backend, false, console, &metrics);

  std::tie(refined.seams_before_db, refined.elsewhere_before_db) =
      MeasureSeams(views, coarse, plan, backend);
  std::tie(refined.psnr_at_seams_db, refined.psnr_elsewhere_db) =
      MeasureSeams(views, stored, plan, backend);
  metrics.refined = refined;
  PutMetrics(metrics, &record.metrics);
  std::vector<std::string> outputs;
  for (const StageOutput& output : before.outputs) outputs.push_back(output.path);
  ForgetStyles(workspace.folder());
  workspace.Record("reconstruct", before.inputs, outputs, before.seconds, record.metrics,
                   before.cpu_seconds);
  folder.Drop();
  for (int block = 0; block < std::ssize(plan.blocks); ++block)
    workspace.DropCheckpoint(BlockStage(block));
  console->EndStage();
  const auto text = [](const Metric& metric) {
    return metric.value ? Format("%.2f", *metric.value) : std::string("-");
  };
  console->Info(Concat("the field has ", metrics.splats.value_or(0), " splats; held out ",
                       text(metrics.psnr_heldout_db), " dB instead of ",
                       text(refined.psnr_before_db)));
  if (refined.psnr_at_seams_db.value)
    console->Info(Concat(
        "within ", kSeamPixels, " pixels of where blocks meet ", text(refined.psnr_at_seams_db),
        " dB instead of ", text(refined.seams_before_db), ", elsewhere ",
        text(refined.psnr_elsewhere_db), " instead of ", text(refined.elsewhere_before_db)));
}

}  // namespace regrade
