#include "pipeline/run/run_settings.h"

#include <algorithm>
#include <iterator>

#include "kernels/base/error.h"
#include "pipeline/images/cube_file.h"
#include "pipeline/run/fit_kind.h"
#include "pipeline/run/paper_config.h"
#include "pipeline/run/vignette.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {

void RunSettings::Bind(OptionSet* options) {
  options->Add("Run", &run);
  options->Add("Start", &start);
  options->Add("Photos", &ingest);
  options->Add("Poses", &pose);
  options->Add("Scene", &scene);
  options->Add("Scene", &splat_input);
  options->Add("Fit", &fit);
  options->Add("Fit", &splats);
  options->Add("Fit", &depth);
  options->Add("Style", &style);
  options->Add("2D method", &style_2d);
  options->Add("Object", &object);
  options->Add("Network", &network);
  options->Add("Residual", &residual);
  options->Add("Render", &render);
  options->Add("Render", &render.films);
  options->Add("Evaluation", &consistency);
  options->Add("Page", &page);
  options->Add("Program", &program);
}

JsonValue OptionsOfFit(const RunSettings& settings) {
  JsonValue values = OptionValues(settings.scene);
  const JsonValue of_kind = FitKindOf(settings).options(settings);
  for (const auto& [name, value] : of_kind.AsObject()) values[name] = value;
  return values;
}

namespace {

void CheckResidual(const RunSettings& settings, StyleMethodKind method) {
  const ResidualChoice& choice = settings.residual;
  if (choice.On() && choice.residual != "views" && choice.Layers().empty())
    throw UsageError("\"" + choice.residual + "\" is no residual", "--residual",
                     "use none, views or layers:DIR");
  if (choice.On() && settings.object.On())
    throw UsageError("a residual is of the whole scene", "--residual and --masks",
                     "leave one of them out");
  if (choice.On() && method == StyleMethodKind::kFolder)
    throw UsageError("a folder has no pictures of renders",
                     "--residual and --method folder:", "use another method");
}

}  // namespace

void CheckMatch(const RunSettings& settings) {
  const StyleSource& style = settings.style;
  if (!style.match.IsKnown())
    throw UsageError("'" + style.match.match + "' is not allowed", "--match",
                     "use none, regions or regions:FILE.onnx");
  if (!style.match.On()) return;
  if (style.pictures.size() < 2)
    throw UsageError("matching needs several pictures", "--match regions",
                     "give --style once for each, or leave --match out");
  if (settings.object.On())
    throw UsageError("regions come from the pictures or from masks", "--match and --masks",
                     "leave one of them out");
  for (const std::string& picture : style.pictures)
    if (IsCubeFile(picture))
      throw UsageError("a LUT has no regions", "--match regions and --style " + picture,
                       "give pictures");
  if (ParseStyleMethod(settings.style_2d).kind == StyleMethodKind::kFolder)
    throw UsageError("a folder holds finished pictures",
                     "--match and --method folder:", "use another method");
}

namespace {

// A requirement that this run cannot measure fails before the work.
void CheckRequirements(const RunSettings& settings) {
  const std::vector<Requirement> required = RequirementsOf(settings);
  if (required.empty() && !settings.start.junit.empty())
    throw UsageError("there are no requirements to report", "--junit", "add --require");
  if (!required.empty() && settings.start.until != "report")
    throw UsageError("metrics are measured after stage " + settings.start.until, "--require",
                     "leave out --until");
  const ConsistencyOptions& evaluated = settings.consistency;
  for (const Requirement& wanted : required) {
    const bool by_network = wanted.metric.starts_with("lpips");
    if ((by_network && evaluated.lpips.empty()) ||
        (wanted.metric == "edge_ssim" && evaluated.edges.empty()))
      throw UsageError("nothing measures it", "--require " + wanted.text,
                       by_network ? "add --lpips FILE.onnx" : "set the constant edges");
    if (!wanted.subject.starts_with(kPathPrefix) || MeasuresFilm(settings)) continue;
    const bool views = settings.render.path.path == "views";
    throw UsageError("the film is not measured on its path, " + wanted.text + " has no number",
                     settings.consistency.mode == "geometry" ? "--mode geometry"
                     : views                                 ? "--path views"
                                                             : "--no-films",
                     "leave it out, or require the metric without path-");
  }
}

}  // namespace

bool MeasuresFilm(const RunSettings& settings) {
  return settings.render.films.films && settings.render.path.path != "views" &&
         settings.consistency.mode != "geometry";
}

void CheckTogether(const RunSettings& settings) {
  const size_t grids = settings.fit.resolutions.size(), steps = settings.fit.steps.size();
  if (grids != steps)
    throw UsageError(Concat(grids, " and ", steps, " stages"), "fit-resolutions and fit-steps",
                     "give both the same number of stages");
  for (const auto& [sides, flag] :
       {std::pair{&settings.fit.resolutions_y, "fit-resolutions-y"},
        std::pair{&settings.fit.resolutions_z, "fit-resolutions-z"}})
    if (!sides->empty() && sides->size() != grids)
      throw UsageError(Concat("has ", sides->size(), " sides for ", grids, " stages"), flag,
                       "leave it out, or give a side for each stage");
  CheckPaper(settings.run.preset, settings.run.paper_config);
  FitKindOf(settings).check(settings);
  if (!settings.depth.network.empty() && settings.scene.Kind().lattice)
    throw UsageError("voxels are fitted without depths", "--depth-network",
                     "leave it out, or give --field splats");
  if (settings.page.page == "on" && settings.scene.Kind().lattice)
    throw UsageError("voxels have no page", "--page on", "give --page off, or fit splats");
  const StyleMethod method = ParseStyleMethod(settings.style_2d);
  CheckResidual(settings, method.kind);
  CheckMatch(settings);
  ParseVignette(settings.render.vignette);
  if (!settings.object.style_mask.empty() && !settings.object.On())
    throw UsageError("labels of the style picture need labels of the photos",
                     "--style-mask and --masks",
                     "give --masks, a folder of labels for the photos");
  CheckRequirements(settings);
}

std::vector<Requirement> RequirementsOf(const RunSettings& settings) {
  return ParseRequirements(settings.start.require, settings.consistency.gaps);
}

}  // namespace regrade
