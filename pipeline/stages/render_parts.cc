#include "pipeline/stages/render_parts.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "evaluate/seen_by_few.h"
#include "kernels/base/error.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/film_timing.h"
#include "pipeline/fields/seen_field.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/npz_file.h"
#include "pipeline/files/text.h"
#include "pipeline/images/joined_film.h"
#include "pipeline/program/memory.h"
#include "pipeline/run/plan.h"
#include "pipeline/stages/frame_writer.h"
#include "pipeline/workspace/folder_lock.h"
#include "pipeline/workspace/output_names.h"
#include "pipeline/workspace/shared_work.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr char kUnitRecord[] = "unit.json", kSeenDepth[] = "seen.npz";
constexpr uint64_t kMostSeen = uint64_t{4} << 30, kMostPicture = uint64_t{1} << 32;

SharedWork PartsOf(const RunContext& context, const JsonValue& inputs) {
  return {context.style->Path(kPartsFolder), inputs};
}

bool IsThere(const std::string& folder, const FrameUnit& unit) {
  return fs::exists(folder + "/" + unit.Name() + "/" + kUnitRecord);
}

void WriteSeen(const std::string& path, const std::vector<SampledView>& views) {
  NpzWriter file;
  for (size_t i = 0; i < views.size(); ++i)
    file.Add(std::to_string(i), {views[i].depth.height, views[i].depth.width},
             views[i].depth.pixels.data(), NpzPacking::kDeflate);
  file.WriteTo(path);
}

// Another process may have rendered the same unit meanwhile; what one left half removed goes.
void PutInPlace(const std::string& made, const std::string& folder, const FrameUnit& unit) {
  const std::string whole = folder + "/" + unit.Name();
  if (!IsThere(folder, unit)) {
    fs::remove_all(whole);
    try {
      RenameDurably(made, whole);
    } catch (const Error&) {
      if (!IsThere(folder, unit)) throw;
    }
  }
  fs::remove_all(made);
}

struct UnitWork {
  RunContext* context;
  const FramePlan& plan;
  SceneFrames* frames;
  const SeenByFewRecorder& seen;
  std::function<void(const FrameSet&)> tick;

  // To a folder of this process's own, which gets its name when it is whole.
  void Do(const std::string& folder, const FrameUnit& unit) const {
    const RenderOptions& options = context->settings.render;
    const std::string whole = folder + "/" + unit.Name(), made = OwnTemporary(whole);
    fs::remove_all(made);
    MakeFolder(made);
    const double before = frames->seconds();
    RunFilms films(made, options.fps, plan.film_frames(),
                   plan.film_of_views() ? options.fps : kSampleRate);
    std::vector<SampledView> seen_here;
    FrameWriter writer(made, ParseVignette(options.vignette), &films);
    RenderUnit(
        unit, seen, tick, [&](SampledView view) { seen_here.push_back(std::move(view)); },
        frames, &writer);
    writer.Finish();
    std::vector<std::string> names;
    films.Finish(&names);
    if (!films.why_none().empty())
      throw ProgramError(films.why_none(), whole,
                         "install FFmpeg's libavcodec with libx264, or add --no-films");
    if (!seen_here.empty()) WriteSeen(made + "/" + kSeenDepth, seen_here);
    WriteJsonFile(made + "/" + kUnitRecord,
                  JsonValue::Object{{"device", frames->device()},
                                    {"seconds", frames->seconds() - before}});
    PutInPlace(made, folder, unit);
  }
};

std::string TextOf(const std::vector<FrameUnit>& units) {
  std::vector<std::string> texts;
  for (const FrameUnit& unit : units) texts.push_back(unit.Text());
  return Join(texts, ", ");
}

}  // namespace

void RenderUnits(const std::vector<FrameUnit>& units, StoredField geometry,
                 const RunContext& context, SceneFrames* frames,
                 const std::function<void(const FrameUnit&)>& render) {
  const std::string field = context.workspace->Path("field.npz");
  const uint64_t memory =
      PlannedMemory(context.settings.run.max_memory_gb, ReadMemoryStatus().available);
  const auto batches = BatchesWithin(units, CountSplats(field), memory);
  for (const std::vector<FrameUnit>& batch : batches) {
    std::vector<Camera> cameras = CamerasOf(batch);
    std::ranges::copy(frames->CamerasOfEdits(), std::back_inserter(cameras));
    frames->Show(SeenPart(std::exchange(geometry, {}), field, cameras));
    for (const FrameUnit& unit : batch) render(unit);
  }
}

void RenderUnit(const FrameUnit& unit, const SeenByFewRecorder& seen,
                const std::function<void(const FrameSet&)>& tick,
                const std::function<void(SampledView)>& sample, SceneFrames* frames,
                FrameWriter* writer) {
  for (int i = unit.begin; i < unit.end; ++i) {
    tick(*unit.set);
    const auto frame = std::make_shared<const Frame>(frames->Render(*unit.set, i));
    if (SeenByFewRecorder::LooksAt(*unit.set, i))
      sample(seen.Sample(*unit.set, i, frame->depth));
    writer->Write(frame, *unit.set, i);
  }
}

void RenderPart(const Stage& stage, RunContext* context) {
  Console* const console = context->console;
  const std::string title = "part " + context->parts.part + " of the frames and films";
  StoredField geometry = ReadFieldGeometry(context->workspace->Path("field.npz"));
  const FramePlan plan = PlanFrames(*context, geometry);
  const SharedWork work = PartsOf(*context, stage.inputs);
  const std::string& folder = work.path();
  std::vector<FrameUnit> units = UnitsOfPart(UnitsOf(plan.sets), context->parts.part);
  std::erase_if(units, [&](const FrameUnit& unit) { return IsThere(folder, unit); });
  if (units.empty()) return console->Info(title + ": nothing is left to do");
  if (context->settings.start.dry_run)
    return console->Info(title + ": would render " + TextOf(units));
  work.Begin();
  console->Info(title + ": " + TextOf(units));
  console->BeginStage("render", title);
  SceneFrames frames(context, plan);
  const SeenByFewRecorder seen(plan.views, plan.near);
  const auto tick = TickOf(units, console->StageProgress());
  RenderUnits(units, std::move(geometry), *context, &frames, [&](const FrameUnit& unit) {
    UnitWork{context, plan, &frames, seen, tick}.Do(folder, unit);
  });
  console->EndStage();
  console->Info(title + ": done in " + DurationText(console->StageSeconds()));
}

namespace {

// A link where the file system has them: the parts stay until all is done.
void TakeOver(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::create_hard_link(from, to, error);
  if (!error) return;
  WriteFileAtomically(to.string(), ReadWholeFile(from.string(), kMostPicture));
}

void TakeFrames(const std::string& from, const std::string& to) {
  for (const auto& entry : fs::recursive_directory_iterator(from)) {
    if (!entry.is_regular_file()) continue;
    const fs::path path = fs::path(to) / fs::relative(entry.path(), from);
    MakeFolder(path.parent_path().string());
    TakeOver(entry.path(), path);
  }
}

void ReadSeen(const std::string& path, const FrameUnit& unit, SeenByFewRecorder* seen) {
  std::optional<NpzReader> file;
  int read = 0;
  for (int i = unit.begin; i < unit.end; ++i) {
    if (!SeenByFewRecorder::LooksAt(*unit.set, i)) continue;
    if (!file) file.emplace(path, kMostSeen);
    SampledView view;
    view.camera = unit.set->cameras[static_cast<size_t>(i)];
    const auto samples = [](int pixels) { return (pixels + kDepthStride - 1) / kDepthStride; };
    view.depth = Image(samples(view.camera.width), samples(view.camera.height), 1);
    const NpzArray array = file->Read(std::to_string(read++), ArrayType::kF32,
                                      {view.depth.height, view.depth.width});
    std::copy_n(array.As<float>(), view.depth.pixels.size(), view.depth.pixels.begin());
    seen->Add(std::move(view));
  }
}

// The film of that name, of all units of the sets that it shows; false where none has it.
bool JoinFilm(const char* name, const std::string& folder, const std::vector<FrameUnit>& units,
              const Workspace& style) {
  const bool of_2d = name == std::string(kViews2dFilm);
  std::vector<FilmPart> films;
  bool any = false;
  for (const FrameUnit& unit : units) {
    if (!(of_2d ? unit.set->of_2d_film : unit.set->of_film)) continue;
    films.push_back({folder + "/" + unit.Name() + "/" + name, unit.end - unit.begin});
    any = any || fs::exists(films.back().path);
  }
  // Not every 2D method can style rendered frames.
  if (films.empty() || (of_2d && !any)) return false;
  JoinFilms(films, style.Path(name));
  return true;
}

std::string TextOf(const std::set<std::string>& words) {
  return Join(std::vector<std::string>(words.begin(), words.end()), ", ");
}

}  // namespace

void RequireParts(const Stage& stage, const RunContext& context) {
  const SharedWork work = PartsOf(context, stage.inputs);
  const FramePlan plan =
      PlanFrames(context, ReadFieldGeometry(context.workspace->Path("field.npz")));
  const std::vector<FrameUnit> units = UnitsOf(plan.sets);
  const std::string& folder = work.path();
  std::vector<FrameUnit> missing = units;
  std::erase_if(missing, [&](const FrameUnit& unit) { return IsThere(folder, unit); });
  if (missing.empty()) return;
  constexpr size_t kNamed = 4;
  const size_t count = missing.size();
  missing.resize(std::min(count, kNamed));
  const std::string others = count == units.size() ? work.OtherSettings() : "";
  throw InputError(
      Concat(count, " of ", units.size(),
             " groups of frames were not rendered: ", TextOf(missing),
             count > kNamed ? ", ..." : "", !others.empty() ? "; " : "", others),
      folder,
      "run `regrade render DIR --part K/N` for each K; what is there is not done again");
}

JoinedParts JoinParts(const JsonValue& inputs, const FramePlan& plan, RunContext* context,
                      SeenByFewRecorder* seen) {
  const std::vector<FrameUnit> units = UnitsOf(plan.sets);
  const std::string folder = PartsOf(*context, inputs).path();
  const Workspace& style = *context->style;
  JoinedParts joined;
  std::set<std::string> devices;
  for (const FrameUnit& unit : units) {
    const std::string of_unit = folder + "/" + unit.Name();
    const JsonValue record = ReadJsonFile(of_unit + "/" + kUnitRecord);
    devices.insert(record.At("device").AsString());
    joined.seconds += record.At("seconds").AsDouble();
    if (fs::exists(of_unit + "/frames")) TakeFrames(of_unit + "/frames", style.Path("frames"));
    ReadSeen(of_unit + "/" + kSeenDepth, unit, seen);
    if (unit.end == static_cast<int>(unit.set->cameras.size())) seen->Finish(*unit.set);
  }
  joined.device = TextOf(devices);
  for (const char* name : {kStyledFilm, kWipeFilm, kViews2dFilm})
    if (JoinFilm(name, folder, units, style)) joined.films.push_back(name);
  return joined;
}

void DropParts(const JsonValue& inputs, const RunContext& context) {
  PartsOf(context, inputs).Drop();
}

void WarnOfOtherParts(const JsonValue& inputs, const RunContext& context) {
  if (const std::string others = PartsOf(context, inputs).OtherSettings(); !others.empty())
    context.console->Warn("nothing is joined, for this film is there; " + others);
}

}  // namespace regrade
