#include "pipeline/stages/render_parts.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <set>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/base/hash.h"
#include "pipeline/fields/film_timing.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/npz_file.h"
#include "pipeline/files/text.h"
#include "pipeline/images/joined_film.h"
#include "pipeline/stages/frame_writer.h"
#include "pipeline/workspace/folder_lock.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr char kUnitRecord[] = "unit.json", kSeenDepth[] = "seen.npz",
               kInputs[] = "inputs.json";
constexpr uint64_t kMostSeen = uint64_t{4} << 30;

std::string FolderOfParts(const RunContext& context) {
  return context.style->Path(kPartsFolder);
}

std::string FolderOfInputs(const RunContext& context, const JsonValue& inputs) {
  return FolderOfParts(context) + "/" + HashText(HashOf(DumpJson(inputs, -1)));
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

struct UnitWork {
  RunContext* context;
  const FramePlan& plan;
  SceneFrames* frames;
  const SeenByFewRecorder& seen;
  std::function<void(const FrameSet&)> tick;

  // To a folder of this process's own, which gets its name when it is whole.
  void Do(const std::string& folder, const FrameUnit& unit) const {
    const RenderOptions& options = context->settings.render;
    const std::string whole = folder + "/" + unit.Name(),
                      made = Concat(whole, "-", HostName(), "-", ::getpid(), kTemporarySuffix);
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
                                    {"film_renderer", frames->film_renderer()},
                                    {"seconds", frames->seconds() - before}});
    if (!IsThere(folder, unit)) RenameDurably(made, whole);
    fs::remove_all(made);
  }
};

std::string TextOf(const std::vector<FrameUnit>& units) {
  std::vector<std::string> texts;
  for (const FrameUnit& unit : units) texts.push_back(unit.Text());
  return Join(texts, ", ");
}

}  // namespace

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
  StoredField before = ReadFieldFile(context->workspace->Path("field.npz"));
  const FramePlan plan = PlanFrames(*context, before);
  const std::string folder = FolderOfInputs(*context, stage.inputs);
  std::vector<FrameUnit> units = UnitsOfPart(UnitsOf(plan.sets), context->parts.part);
  std::erase_if(units, [&](const FrameUnit& unit) { return IsThere(folder, unit); });
  if (units.empty()) return console->Info(title + ": nothing is left to do");
  if (context->settings.start.dry_run)
    return console->Info(title + ": would render " + TextOf(units));
  MakeFolder(folder);
  WriteJsonFile(folder + "/" + kInputs, stage.inputs);
  console->Info(title + ": " + TextOf(units));
  console->BeginStage("render", title);
  SceneFrames frames(context, plan, std::move(before), [](StoredField) {});
  const SeenByFewRecorder seen(plan.views, plan.near);
  double work = 0, done = 0;
  for (const FrameUnit& unit : units) work += WorkOf(*unit.set) * (unit.end - unit.begin);
  const ProgressFunction progress = console->StageProgress();
  const auto tick = [&](const FrameSet& set) {
    ReportOrThrow(progress, done, work);
    done += WorkOf(set);
  };
  for (const FrameUnit& unit : units)
    UnitWork{context, plan, &frames, seen, tick}.Do(folder, unit);
  console->EndStage();
  console->Info(title + ": done in " + DurationText(console->StageSeconds()));
}

namespace {

// What else was rendered, where nothing of these inputs was.
std::string OtherParts(const RunContext& context, const JsonValue& inputs) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(FolderOfParts(context), error))
    if (fs::exists(entry.path() / kInputs))
      return "; there are parts of other settings: " +
             Join(Differences(ReadJsonFile((entry.path() / kInputs).string()), inputs), "; ");
  return "";
}

// A link where the file system has them: the parts stay until the stage is recorded.
void TakeOver(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::create_hard_link(from, to, error);
  if (!error) return;
  fs::copy_file(from, to, fs::copy_options::overwrite_existing, error);
  if (error) throw ResourceError("cannot copy here: " + error.message(), to.string());
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
  NpzReader file(path, kMostSeen);
  int read = 0;
  for (int i = unit.begin; i < unit.end; ++i) {
    if (!SeenByFewRecorder::LooksAt(*unit.set, i)) continue;
    const NpzArray array = file.Read(std::to_string(read++), ArrayType::kF32, {-1, -1});
    SampledView view;
    view.camera = unit.set->cameras[static_cast<size_t>(i)];
    view.depth = Image(static_cast<int>(array.shape[1]), static_cast<int>(array.shape[0]), 1);
    std::copy_n(array.As<float>(), view.depth.pixels.size(), view.depth.pixels.begin());
    seen->Add(std::move(view));
  }
}

std::string TextOf(const std::set<std::string>& words) {
  return Join(std::vector<std::string>(words.begin(), words.end()), ", ");
}

}  // namespace

void RequireParts(const Stage& stage, const RunContext& context) {
  const JsonValue& inputs = stage.inputs;
  const FramePlan plan =
      PlanFrames(context, ReadFieldFile(context.workspace->Path("field.npz")));
  const std::vector<FrameUnit> units = UnitsOf(plan.sets);
  const std::string folder = FolderOfInputs(context, inputs);
  std::vector<FrameUnit> missing = units;
  std::erase_if(missing, [&](const FrameUnit& unit) { return IsThere(folder, unit); });
  if (missing.empty()) return;
  constexpr size_t kNamed = 4;
  const size_t count = missing.size();
  missing.resize(std::min(count, kNamed));
  throw InputError(
      Concat(count, " of ", units.size(), " groups of frames were not rendered: ",
             TextOf(missing), count > kNamed ? ", ..." : "",
             count == units.size() ? OtherParts(context, inputs) : ""),
      folder,
      "run `regrade render DIR --part K/N` for each K; what is there is not done again");
}

JoinedParts JoinParts(const JsonValue& inputs, const FramePlan& plan, RunContext* context,
                      SeenByFewRecorder* seen) {
  const std::vector<FrameUnit> units = UnitsOf(plan.sets);
  const std::string folder = FolderOfInputs(*context, inputs);
  const Workspace& style = *context->style;
  JoinedParts joined;
  std::set<std::string> devices, renderers;
  for (const FrameUnit& unit : units) {
    const std::string of_unit = folder + "/" + unit.Name();
    const JsonValue record = ReadJsonFile(of_unit + "/" + kUnitRecord);
    devices.insert(record.At("device").AsString());
    renderers.insert(record.At("film_renderer").AsString());
    joined.seconds += record.At("seconds").AsDouble();
    if (fs::exists(of_unit + "/frames")) TakeFrames(of_unit + "/frames", style.Path("frames"));
    if (const std::string depth = of_unit + "/" + kSeenDepth; fs::exists(depth))
      ReadSeen(depth, unit, seen);
    if (unit.end == static_cast<int>(unit.set->cameras.size())) seen->Finish(*unit.set);
  }
  joined.device = TextOf(devices);
  joined.film_renderer = TextOf(renderers);
  for (const char* name : {kStyledFilm, kWipeFilm, kViews2dFilm}) {
    std::vector<std::string> films;
    for (const FrameUnit& unit : units)
      if (const std::string film = folder + "/" + unit.Name() + "/" + name; fs::exists(film))
        films.push_back(film);
    if (films.empty()) continue;
    JoinFilms(films, style.Path(name));
    joined.films.push_back(name);
  }
  return joined;
}

void DropParts(const RunContext& context) {
  std::error_code error;
  fs::remove_all(FolderOfParts(context), error);
}

}  // namespace regrade
