// regrade tradeoff: what each parameter costs in time and buys in accuracy, measured on this
// machine with a capture of one's own.
#include <omp.h>

#include <algorithm>
#include <chrono>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/base/hash.h"
#include "kernels/field/cpu/rays.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/commands/command.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/program/interrupt.h"
#include "pipeline/report/chart_library.h"
#include "pipeline/report/html.h"
#include "pipeline/report/json.h"
#include "pipeline/run/run_file.h"
#include "pipeline/run_pipeline.h"
#include "pipeline/stages/make_stylizer.h"
#include "pipeline/tradeoff/cost_table.h"
#include "pipeline/tradeoff/duration_estimate.h"
#include "pipeline/tradeoff/prediction.h"
#include "pipeline/tradeoff/variant_runner.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

struct TradeoffOptions {
  std::string parameters, presets = "draft,standard", predict, costs;
  int repeats = 3;
  double budget = 0;
  bool with_poses = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("parameters", parameters,
         {.help = "only these, with commas between; empty measures all"});
    bind("presets", presets,
         {.help =
              "measured as points beside the parameters, dear and last; none leaves them out"});
    bind("repeats", repeats,
         {.unit = "measurements",
          .help = "of everything, in an order that turns from one to the next, each with "
                  "another seed; medians are printed, and with one alone there is no spread",
          .min = 1,
          .max = 100});
    bind("budget", budget,
         {.unit = "minutes",
          .help = "after it no measurement begins but the first; the same command again goes "
                  "on; 0 has no "
                  "end",
          .min = 0,
          .max = 1e6});
    bind(
        "with-poses", with_poses,
        {.help = "COLMAP's parameters too, where photos are given: its time is measured anew"});
    bind("predict", predict,
         {.help = "a run's folder: what --costs say it should have taken, beside what it did"});
    bind("costs", costs, {.help = "the tradeoff.json to predict from"});
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

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

// One measurement that is to be made.
struct Job {
  const Variant* variant;
  int repeat;
};

// Each repetition begins elsewhere in the list, so that what the machine does meanwhile falls
// on all variants alike.
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

// A preset that is the base is measured already.
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

std::string Fingerprint(const RunContext& base, const Workspace& workspace) {
  std::string all =
      std::string(REGRADE_VERSION) + FastRays().name + std::to_string(omp_get_max_threads());
  for (const char* stage : {"pose", "reconstruct", "style_2d"})
    if (const auto record = workspace.Find(stage))
      all += HashText(HashOf(DumpJson(record->inputs, -1)));
  const JsonValue values = base.options.Values();
  for (const auto& [name, value] : values.AsObject())
    if (name != "out" && name != "json" && base.options.Values("Start").Find(name) == nullptr)
      all += name + DumpJson(value, -1);
  return HashText(HashOf(all));
}

void WriteResults(const RunContext& base, const TradeoffOptions& tradeoff,
                  const std::string& folder, const std::vector<Variant>& variants,
                  const MeasurementStore& store, const std::string& base_name) {
  const std::vector<CostRow> rows = CostTable(variants, store.all(), base_name);
  const Capture capture = ReadCapture(base.workspace->Path("poses"));
  JsonValue::Array costs, measured;
  for (const CostRow& row : rows) costs.push_back(CostJson(row));
  for (const Measurement& m : store.all()) measured.push_back(ToJson(m));
  const std::vector<CostTerm> terms =
      LearnCosts(base.settings, capture, *base.workspace, variants, store.all());
  WriteJsonFile(folder + "/tradeoff.json",
                JsonValue::Object{{"schema", 1},
                                  {"regrade", REGRADE_VERSION},
                                  {"base", base_name},
                                  {"repeats", tradeoff.repeats},
                                  {"threads", omp_get_max_threads()},
                                  {"instructions", FastRays().name},
                                  {"costs", std::move(costs)},
                                  {"unit_costs", ToJson(terms)},
                                  {"measurements", std::move(measured)}});
  WriteFileAtomically(folder + "/tradeoff.csv", CostTableCsv(rows));
  RunReport report;
  report.version = REGRADE_VERSION;
  report.preset = base.settings.run.preset;
  report.device = "cpu";
  report.costs = rows;
  for (const Measurement& m : store.all()) report.seconds += m.seconds;
  ReportPictures pictures;
  pictures.title = "prices of " + fs::path(base.source).filename().string();
  pictures.chart_library = ReadChartLibrary();
  WriteFileAtomically(folder + "/tradeoff.html", ReportHtml(report, pictures));
  base.console->Event("costs", JsonValue::Object{{"file", folder + "/tradeoff.json"}});
  base.console->Lines(CostTableText(rows));
}

// What is not measured yet, one at a time, until all is or the budget is spent.
void MeasureAll(RunContext* base, const TradeoffOptions& tradeoff, const std::string& folder,
                const std::vector<Variant>& variants, Clock::time_point begin,
                MeasurementStore* store) {
  std::vector<Job> jobs = JobsOf(variants, tradeoff.repeats);
  std::erase_if(
      jobs, [&](const Job& job) { return store->Find(*job.variant, job.repeat) != nullptr; });
  Console* console = base->console;
  DurationEstimate guess(base->settings, store->all());
  VariantRunner bench(base, folder + "/work");
  for (size_t i = 0; i < jobs.size(); ++i) {
    double left = 0;
    for (size_t k = i; k < jobs.size(); ++k) left += guess.Seconds(*jobs[k].variant);
    if (i > 0 && tradeoff.budget > 0 && SecondsSince(begin) > 60 * tradeoff.budget) {
      console->Warn("the budget is spent: " + std::to_string(jobs.size() - i) +
                    " measurements are left, about " + DurationText(left) +
                    "; the same command goes on");
      return;
    }
    console->Info("[" + std::to_string(i + 1) + "/" + std::to_string(jobs.size()) + "] " +
                  NameOf(*jobs[i].variant) + ", about " + DurationText(left) + " left");
    console->SetQuiet(true);
    Measurement m;
    try {
      m = bench.Measure(*jobs[i].variant, jobs[i].repeat, console->StageProgress());
    } catch (...) {
      console->SetQuiet(false);
      throw;
    }
    console->SetQuiet(false);
    store->Add(m);
    guess.Add(m);
    if (StopRequested()) throw Interrupted();
  }
}

// The options of the base's run: everything but what stages of a trial are not given.
void CheckOptions(const RunSettings& settings, const TradeoffOptions& tradeoff) {
  if (settings.run.out.empty())
    throw Error(ExitCode::kUsage, "its value is missing", "--out",
                "name the folder that the prices shall go to");
  if (settings.object.On())
    throw Error(ExitCode::kUsage, "prices are of whole scenes", "--masks", "leave it out");
  if (settings.run.device == "cuda")
    throw Error(ExitCode::kUsage, "prices are the processor's so far", "--device",
                "take --device cpu");
  if (!settings.start.config.empty() || !settings.start.restart_from.empty())
    throw Error(ExitCode::kUsage, "has no meaning here", "--config and --restart-from",
                "leave them out; remove the folder to begin anew");
  for (const std::string& preset : Words(tradeoff.presets)) PresetOptions(preset);
}

void PrintPrediction(const TradeoffOptions& tradeoff, Console* console) {
  if (tradeoff.costs.empty())
    throw Error(ExitCode::kUsage, "its value is missing", "--costs",
                "name the tradeoff.json that `regrade tradeoff` wrote");
  const std::vector<CostTerm> costs =
      CostsFromJson(ReadJsonFile(tradeoff.costs), tradeoff.costs);
  if (!Workspace::Exists(tradeoff.predict))
    throw Error(ExitCode::kInput, "no run has worked in this folder", tradeoff.predict,
                "make one with `regrade run`");
  RunContext run;
  run.settings.Bind(&run.options);
  const std::string run_json = tradeoff.predict + "/run.json";
  const RunFile file = ReadRunFile(run_json);
  if (const JsonValue* preset = file.options.Find("preset"))
    ApplyPreset(preset->AsString(), &run.settings);
  run.options.ApplyConfig(file.options, run_json);
  Workspace workspace(tradeoff.predict);
  const Capture capture = ReadCapture(workspace.Path("poses"));
  char line[160];
  std::snprintf(line, sizeof line, "%-12s %12s %12s %7s %12s %12s %7s", "stage", "predicted s",
                "took s", "ratio", "predicted", "CPU s", "ratio");
  console->Lines(line);
  JsonValue::Array rows;
  StageTime all{"all", 0, 0}, took{"all", 0, 0};
  const auto print = [&](const StageTime& said, const StageTime& was) {
    const double wall = was.seconds > 0 ? said.seconds / was.seconds : 0,
                 cpu = was.cpu_seconds > 0 ? said.cpu_seconds / was.cpu_seconds : 0;
    std::snprintf(line, sizeof line, "%-12s %12.1f %12.1f %7.2f %12.1f %12.1f %7.2f",
                  said.stage.c_str(), said.seconds, was.seconds, wall, said.cpu_seconds,
                  was.cpu_seconds, cpu);
    console->Lines(line);
    rows.push_back(JsonValue::Object{{"stage", said.stage},
                                     {"predicted_seconds", said.seconds},
                                     {"seconds", was.seconds},
                                     {"predicted_cpu_seconds", said.cpu_seconds},
                                     {"cpu_seconds", was.cpu_seconds}});
  };
  for (const StageTime& said : Predict(costs, run.settings, capture)) {
    const auto record = workspace.Find(said.stage);
    if (!record) continue;
    const StageTime was{said.stage, record->seconds, record->cpu_seconds.value_or(0)};
    print(said, was);
    all.seconds += said.seconds, all.cpu_seconds += said.cpu_seconds;
    took.seconds += was.seconds, took.cpu_seconds += was.cpu_seconds;
  }
  print(all, took);
  console->Event("prediction", JsonValue::Object{{"stages", std::move(rows)}});
}

}  // namespace

void RunTradeoff(const Command& command, const Arguments& arguments, Console* console) {
  const Clock::time_point begin = Clock::now();
  TradeoffOptions tradeoff;
  RunContext base;
  base.console = console;
  RunSettings& settings = base.settings;
  ApplyPreset("draft", &settings);  // a price list of the standard preset takes hours
  settings.Bind(&base.options);     // what a run has; flags are read with ours beside
  OptionSet flags;
  settings.Bind(&flags);
  flags.Add("Tradeoff", &tradeoff);
  if (PrintedHelp(command, arguments, flags)) return;
  const Arguments words = flags.Parse(arguments);
  if (const auto preset = flags.Given("preset")) ApplyPreset(*preset, &settings);
  ApplyRecipeFlag(&flags, &settings);
  flags.ApplyFlags();
  ApplyProgramOptions(settings.program);
  if (!tradeoff.predict.empty()) {
    CheckWords(command, words, 0, 0);
    return PrintPrediction(tradeoff, console);
  }
  CheckWords(command, words, 1, 1);
  CheckOptions(settings, tradeoff);
  CheckTogether(settings);
  base.source = fs::absolute(words[0]).lexically_normal().string();
  const CaptureSource source = DetectCapture(base.source);
  const bool style = !settings.style.picture.empty();
  if (style) {
    settings.style.picture = fs::absolute(settings.style.picture).lexically_normal().string();
    ReadStylePicture(settings.style.picture, nullptr);
    ProbeMethod(&settings.style_2d);
  }
  ParameterChoice choice{Words(tradeoff.parameters),
                         tradeoff.with_poses && source.kind == CaptureKind::kPhotos, style,
                         Words(tradeoff.presets)};
  const std::string base_name = BaseName(settings, base.options, &choice.presets);
  const std::vector<Variant> variants = VariantsOf(settings, choice);
  if (settings.start.dry_run) {
    const DurationEstimate guess(settings, {});
    double all = 0;
    for (const Variant& variant : variants) {
      console->Info(NameOf(variant) + ", about " + DurationText(guess.Seconds(variant)));
      all += guess.Seconds(variant);
    }
    console->Info(std::to_string(variants.size()) + " variants, " +
                  std::to_string(tradeoff.repeats) + " times each: about " +
                  DurationText(all * tradeoff.repeats) + ", and the base before");
    return;
  }
  settings.run.device = "cpu";
  const std::string folder = fs::absolute(settings.run.out).lexically_normal().string();
  settings.run.out = folder + "/base";
  Workspace workspace(settings.run.out, settings.start.break_lock);
  base.workspace = &workspace;
  console->OpenLog(workspace.Path(".regrade/log.txt"));
  RunPipeline("pose", style ? "evaluate" : "reconstruct", &base);
  WriteRunFile("run", base);
  MeasurementStore store(folder + "/measurements.json", Fingerprint(base, workspace));
  MeasureAll(&base, tradeoff, folder, variants, begin, &store);
  WriteResults(base, tradeoff, folder, variants, store, base_name);
}

}  // namespace regrade
