// regrade tradeoff: measures the cost of each parameter in time and its gain in accuracy, on
// this machine with a given capture.
#include <omp.h>

#include <algorithm>
#include <filesystem>
#include <optional>

#include "kernels/base/clock.h"
#include "kernels/base/error.h"
#include "kernels/base/hash.h"
#include "kernels/field/cpu/rays.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/ingest_photos.h"
#include "pipeline/capture/scene_profile.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/commands/command.h"
#include "pipeline/commands/probe_styles.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/program/interrupt.h"
#include "pipeline/report/cost_rows.h"
#include "pipeline/report/html.h"
#include "pipeline/run/resolve_settings.h"
#include "pipeline/run/run_file.h"
#include "pipeline/run_pipeline.h"
#include "pipeline/stages/make_stylizer.h"
#include "pipeline/stages/scene_source.h"
#include "pipeline/study/cost_table.h"
#include "pipeline/study/duration_estimate.h"
#include "pipeline/study/variant_runner.h"
#include "pipeline/workspace/metrics_json.h"
#include "pipeline/workspace/style_folders.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

struct TradeoffOptions {
  std::string parameters, presets = "draft,standard";
  int repeats = 3;
  double budget = 0;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("parameters", parameters,
         {.help = "measure only these, comma-separated; empty measures all but "
                  "pose-image-size, which photos without poses have"});
    bind("presets", presets,
         {.help =
              "presets to measure as well, comma-separated; expensive and measured last; none "
              "omits them"});
    bind("repeats", repeats,
         {.unit = "repetitions",
          .help = "of each measurement, with another seed each time; tables show medians, and "
                  "spreads for 2 or more",
          .min = 1,
          .max = 100});
    bind("budget", budget,
         {.unit = "minutes",
          .help = "starts no further measurement after this time, the base run included, which "
                  "is made to its end; the same command continues; 0 has no limit",
          .min = 0,
          .max = 1e6});
  }
};

std::vector<std::string> Words(const std::string& text) {
  std::vector<std::string> words;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(',', begin), text.size());
    if (end > begin && text.substr(begin, end - begin) != "none")
      words.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return words;
}

// A measurement to make.
struct Job {
  const Variant* variant;
  int repeat;
};

// Each repetition starts at another variant, so that other load on the machine affects all
// variants equally.
std::vector<Job> JobsOf(const std::vector<Variant>& variants, int repeats) {
  std::vector<Job> jobs;
  const size_t n = variants.size();
  for (int r = 0; r < repeats; ++r)
    for (size_t i = 0; i < n; ++i)
      jobs.push_back(
          {&variants[(i + static_cast<size_t>(r) * n / static_cast<size_t>(repeats)) % n], r});
  return jobs;
}

std::string NameOf(const Variant& variant) {
  if (variant.parameter.empty()) return variant.benchmark + ": the base";
  return variant.benchmark + ": " + variant.parameter + " " + variant.value;
}

// Names the base, and removes a preset that equals it from `presets`.
std::string BaseName(const RunSettings& settings, const OptionSet& options,
                     std::vector<std::string>* presets) {
  const auto same = [&](const std::string& preset) {
    const JsonValue of_preset = PresetOptions(preset), values = options.Values();
    for (const auto& [name, value] : of_preset.AsObject())
      if (!(values.At(name) == value)) return false;
    return true;
  };
  std::string name = "--preset " + settings.run.preset + " with options";
  if (same(settings.run.preset)) name = "preset " + settings.run.preset;
  std::erase_if(*presets, same);
  return name;
}

std::string Fingerprint(const RunContext& base) {
  std::string all = Concat(REGRADE_VERSION, FastRays().name, omp_get_max_threads());
  for (const char* stage : {"pose", "reconstruct", "style_2d"})
    if (!IsOfScene(stage) && base.style == nullptr)
      continue;
    else if (const auto record = base.FolderOf(stage).Find(stage))
      all += HashText(HashOf(DumpJson(record->inputs, -1)));
  const JsonValue values = base.options.Values();
  for (const auto& [name, value] : values.AsObject())
    if (name != "out" && name != "json" &&
        OptionValues(base.settings.start).Find(name) == nullptr)
      all += name + DumpJson(value, -1);
  return HashText(HashOf(all));
}

void WriteResults(const RunContext& base, const TradeoffOptions& tradeoff,
                  const std::string& folder, const std::vector<Variant>& variants,
                  const MeasurementStore& store, const std::string& base_name) {
  const std::vector<CostRow> rows = CostTable(variants, store.all(), base_name);
  JsonValue::Array costs, measured;
  for (const CostRow& row : rows) costs.push_back(MetricsToJson(row));
  for (const Measurement& m : store.all()) measured.push_back(ToJson(m));
  WriteJsonFile(folder + "/tradeoff.json",
                JsonValue::Object{{"schema", kTradeoffSchema},
                                  {"regrade", REGRADE_VERSION},
                                  {"base", base_name},
                                  {"repeats", tradeoff.repeats},
                                  {"threads", omp_get_max_threads()},
                                  {"instructions", FastRays().name},
                                  {"costs", std::move(costs)},
                                  {"measurements", std::move(measured)}});
  WriteFileAtomically(folder + "/tradeoff.csv", CostTableCsv(rows));
  RunReport report;
  report.version = REGRADE_VERSION;
  report.preset = base.settings.run.preset;
  report.device = "cpu";
  report.costs = rows;
  for (const Measurement& m : store.all()) report.seconds += m.seconds;
  ReportPictures pictures;
  pictures.title = "costs of " + fs::path(base.source).filename().string();
  WriteFileAtomically(folder + "/tradeoff.html", ReportHtml(report, pictures));
  base.console->Event("costs", JsonValue::Object{{"file", folder + "/tradeoff.json"}});
  base.console->Lines(CostTableText(rows));
}

// What changes when a stage is done again; "" without a record.
std::string StateOf(const Workspace& workspace, const char* stage) {
  const auto record = workspace.Find(stage);
  if (!record) return "";
  return DumpJson(record->inputs, -1) + Format(" %.17g", record->seconds);
}

// Of a fit on the CPU: its photos and their pixels, at working size.
FitPlace PlaceOfPhotos(const RunSettings& settings, const Capture& capture) {
  const std::vector<bool> held_out = HeldOutViews(capture, settings.run.holdout);
  FitPlace place;
  for (size_t i = 0; i < capture.views.size(); ++i) {
    if (held_out[i]) continue;
    const Camera camera =
        WorkingCamera(capture.views[i].camera, settings.scene.photo_size, {}, {});
    place.pixels += int64_t{camera.width} * camera.height, ++place.photos;
  }
  return place;
}

// Before any photo is read, see ExpectedPixels.
FitPlace ExpectedPlace(const RunSettings& settings, int64_t photos) {
  FitPlace place;
  place.pixels = ExpectedPixels(photos, settings.scene.photo_size, settings.run.holdout);
  place.photos = photos;
  return place;
}

// The time of measurements, and of the base run where there was none.
struct Budget {
  double begin = 0;        // of the command, in ClockSeconds()
  double seconds = 0;      // 0: no limit
  bool made_base = false;  // in this start

  bool Spent() const { return seconds > 0 && ClockSeconds() - begin > seconds; }
};

// Before the work: what is the least budget that a measurement fits into?
void SayLeastBudget(const TradeoffOptions& tradeoff, double base_seconds, double first_seconds,
                    Console* console) {
  if (tradeoff.budget <= 0) return;
  const double least = (base_seconds + first_seconds) / 60;
  const std::string text =
      (base_seconds > 0 ? "the base run takes about " + DurationText(base_seconds) + " and "
                        : std::string()) +
      "the first measurement takes about " + DurationText(first_seconds) +
      Format(": the least useful --budget is about %.1f minutes", least);
  console->Event("budget", JsonValue::Object{{"minutes", tradeoff.budget},
                                             {"least_minutes", least},
                                             {"base_seconds", base_seconds},
                                             {"first_seconds", first_seconds}});
  if (tradeoff.budget < least)
    console->Warn(text + Format(", not %g", tradeoff.budget));
  else
    console->Info(text);
}

// Makes the missing measurements, one at a time, until the budget is spent. One is made in any
// case, unless this start has made the base run: so that starts with a small budget go on.
void MeasureAll(RunContext* base, const TradeoffOptions& tradeoff, const std::string& folder,
                const std::vector<Variant>& variants, const Budget& budget,
                MeasurementStore* store) {
  std::vector<Job> jobs = JobsOf(variants, tradeoff.repeats);
  std::erase_if(
      jobs, [&](const Job& job) { return store->Find(*job.variant, job.repeat) != nullptr; });
  Console* console = base->console;
  const Capture capture = ReadCapture(base->workspace->Path("poses"));
  DurationEstimate estimate(
      base->settings, store->all(),
      [&capture](const RunSettings& settings) { return PlaceOfPhotos(settings, capture); });
  VariantRunner runner(base, folder + "/work");
  for (size_t i = 0; i < jobs.size(); ++i) {
    double left = 0;
    for (size_t k = i; k < jobs.size(); ++k) left += estimate.Seconds(*jobs[k].variant);
    if ((i > 0 || budget.made_base) && budget.Spent()) {
      console->Warn(Concat("the budget is spent: ", jobs.size() - i,
                           " measurements remain, about ", DurationText(left),
                           "; the same command continues"));
      return;
    }
    console->Info(Concat("[", i + 1, "/", jobs.size(), "] ", NameOf(*jobs[i].variant),
                         ", about ", DurationText(left), " left"));
    console->SetQuiet(true);
    Measurement m;
    try {
      m = runner.Measure(*jobs[i].variant, jobs[i].repeat, console->StageProgress());
    } catch (...) {
      console->SetQuiet(false);
      throw;
    }
    console->SetQuiet(false);
    store->Add(m);
    estimate.Add(m);
    if (StopRequested()) throw Interrupted();
  }
}

// Refuses options that do not apply to measurements.
void CheckOptions(const RunSettings& settings, const TradeoffOptions& tradeoff) {
  RequireValue(settings.run.out, "--out", "name the folder for the results");
  if (settings.object.On())
    throw UsageError("costs are measured for whole scenes", "--masks", "omit it");
  if (settings.run.device == "cuda")
    throw UsageError("costs are measured on the CPU only", "--device", "use --device cpu");
  if (!settings.start.restart_from.empty())
    throw UsageError("not supported by tradeoff", "--restart-from",
                     "omit it; remove the folder to start over");
  for (const std::string& preset : Words(tradeoff.presets)) PresetOptions(preset);
}

}  // namespace

void RunTradeoff(const Command& command, const Arguments& arguments, Console* console) {
  Budget budget{ClockSeconds()};
  TradeoffOptions tradeoff;
  RunContext base;
  base.console = console;
  RunSettings& settings = base.settings;
  settings.Bind(&base.options);  // a run's options; `flags` has those of tradeoff, too
  OptionSet flags;
  settings.Bind(&flags);
  flags.Add("Tradeoff", &tradeoff);
  // Measuring the standard preset takes hours.
  const auto prepared = Prepare(command, arguments,
                                {.least_words = 1, .most_words = 1, .preset = "draft"}, &flags);
  if (!prepared) return;
  RefuseRequirements(flags);
  const Arguments& words = prepared->words;
  CheckOptions(settings, tradeoff);
  CheckTogether(settings);
  base.source = AbsolutePath(words[0]);
  SourceOf(base).probe(&base);
  const CaptureSource source = base.Source();
  const bool style = !settings.style.pictures.empty();
  if (style) {
    if (settings.style.pictures.size() > 1)
      throw UsageError("costs are measured with one picture", "--style", "give one");
    if (settings.style.match.On())
      throw UsageError("costs are measured with one picture", "--match", "leave it out");
    settings.style.pictures[0] = AbsolutePath(settings.style.picture());
    CheckStyle(settings.style.picture(), settings);
    ProbeMethod(&settings.style_2d, settings.start.dry_run
                                        ? NetworkAccess()
                                        : AccessAfterYes(settings.start.yes, console));
  }
  ParameterChoice choice{Words(tradeoff.parameters), source.kind == CaptureKind::kPhotos, style,
                         Words(tradeoff.presets)};
  const std::string base_name = BaseName(settings, base.options, &choice.presets);
  const std::vector<Variant> variants = VariantsOf(settings, choice);
  const int64_t photos = ExpectedPhotos(InputsOf(source), settings.ingest);
  const DurationEstimate estimate(
      settings, {}, [photos](const RunSettings& of) { return ExpectedPlace(of, photos); });
  if (settings.start.dry_run) {
    double all = 0;
    for (const Variant& variant : variants) {
      console->Info(NameOf(variant) + ", about " + DurationText(estimate.Seconds(variant)));
      all += estimate.Seconds(variant);
    }
    console->Info(Concat(variants.size(), " variants, ", tradeoff.repeats,
                         " times each: about ", DurationText(all * tradeoff.repeats),
                         ", and a run of the base"));
    const bool has_base = fs::exists(settings.run.out + "/base/field.npz");
    if (!variants.empty())
      SayLeastBudget(tradeoff, has_base ? 0 : estimate.BaseSeconds(photos, style),
                     estimate.Seconds(variants.front()), console);
    return;
  }
  settings.run.device = "cpu";
  const std::string folder = AbsolutePath(settings.run.out);
  settings.run.out = folder + "/base";
  Workspace workspace(settings.run.out);
  base.workspace = &workspace;
  console->OpenLog(workspace.Path(".regrade/log.txt"));
  budget.seconds = 60 * tradeoff.budget;
  const bool has_base = workspace.Find("reconstruct").has_value();
  if (!variants.empty())
    SayLeastBudget(tradeoff, has_base ? 0 : estimate.BaseSeconds(photos, style),
                   estimate.Seconds(variants.front()), console);
  const std::string scene_before = StateOf(workspace, "reconstruct");
  RunPipeline("pose", "reconstruct", &base);
  budget.made_base = StateOf(workspace, "reconstruct") != scene_before;
  WriteRunFile("run", base);
  std::optional<Workspace> of_style;
  if (style) {
    const NamedStyle named =
        NameStyles(settings.run.out, settings.style.pictures, settings.style.name)[0];
    settings.style.name = named.name;
    of_style.emplace(StyleFolder(settings.run.out, named.name));
    base.style = &*of_style;
    WriteRunFile("run", base);
    const std::string style_before = StateOf(*of_style, "evaluate");
    RunPipeline("style_2d", "evaluate", &base);
    budget.made_base = budget.made_base || StateOf(*of_style, "evaluate") != style_before;
    WriteRunFile("run", base);
  }
  MeasurementStore store(folder + "/measurements.json", Fingerprint(base));
  MeasureAll(&base, tradeoff, folder, variants, budget, &store);
  if (store.all().empty()) return;  // the budget went into the base run
  WriteResults(base, tradeoff, folder, variants, store, base_name);
}

}  // namespace regrade
