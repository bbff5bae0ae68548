// The table of stages: their times, and the labelled members of their metrics.
#include <algorithm>
#include <type_traits>
#include <vector>

#include "pipeline/report/chart.h"
#include "pipeline/report/html_table.h"
#include "pipeline/report/html_text.h"
#include "pipeline/report/tables.h"

namespace regrade {
namespace {

// The measurements of a stage that have a label, as "label value" clauses.
struct RowWriter {
  std::string html;

  void Add(const std::string& clause) { html += (html.empty() ? "" : " · ") + clause; }

  template <typename T>
  void operator()(const char* key, T& member, const MetricInfo& info = {}) {
    if constexpr (requires { *member; }) {
      if (member) (*this)(key, *member, info);
    } else if constexpr (requires { member.Describe(*this); }) {
      member.Describe(*this);
    } else {
      Write(member, info);
    }
  }

 private:
  void AddValue(const MetricInfo& info, const std::string& value) {
    Add(std::string(info.label) + " <b>" + value + "</b>");
  }
  void Write(const Metric& metric, const MetricInfo& info) {
    if (*info.label) AddValue(info, MetricHtml(metric, info.decimals, info.unit));
  }
  void Write(double number, const MetricInfo& info) { Write(Metric(number), info); }
  void Write(int64_t number, const MetricInfo& info) {
    if (*info.label)
      AddValue(info, GroupedNumber(number) + (*info.unit ? "&nbsp;" : "") + info.unit);
  }
  void Write(int number, const MetricInfo& info) { Write(int64_t{number}, info); }
  void Write(const std::string& text, const MetricInfo& info) {
    if (*info.label && !text.empty()) AddValue(info, EscapeHtml(text));
  }
  template <typename T>
  void Write(const std::vector<T>& list, const MetricInfo& info) {
    Write(static_cast<int64_t>(list.size()), info);
  }
};

// How differences of pairs of pixels compare with the certified bound.
void AddVariance(const VarianceMetrics& variance, const std::string& pixels, RowWriter* row) {
  const auto add = [&](const VarianceGroupMetrics& group, const char* where) {
    if (group.pairs == 0) return;
    row->Add("<b>" + GroupedNumber(group.above) + " of " + GroupedNumber(group.pairs) +
             "</b> pairs of " + pixels + " above the bound " + where + " (largest excess " +
             MetricHtml(group.largest_excess, 3) + ", mean gain " + MetricHtml(group.gain, 2) +
             ")");
  };
  add(variance.valid, "where the premises of the guarantee hold");
  add(variance.clamped, "where a colour is clamped");
  add(variance.transparent, "where light passes through the scene");
  add(variance.spheres.value_or(VarianceGroupMetrics()), "on background spheres");
  add(variance.partial.value_or(VarianceGroupMetrics()), "at or beside the styled object");
}

template <typename Stage>
std::string MeasurementsHtml(const Stage& stage) {
  RowWriter row;
  Stage members = stage;
  members.Describe(row);
  if constexpr (std::is_same_v<Stage, PoseStageReport>)
    if (stage.models_found > 1)
      row.Add(std::to_string(stage.models_found) + " separate models found");
  if constexpr (std::is_same_v<Stage, RenderReport>)
    if (stage.film.width > 0)
      row.Add("film <b>" + std::to_string(stage.film.width) + " × " +
              std::to_string(stage.film.height) + "&nbsp;px</b>");
  if constexpr (std::is_same_v<Stage, RenderReport>)
    if (const std::string sentence = stage.seen_by_few.Sentence(); !sentence.empty())
      row.Add(EscapeHtml(sentence));
  if constexpr (std::is_same_v<Stage, StylizeReport>) {
    if (stage.variance) AddVariance(*stage.variance, "neighbouring pixels", &row);
    if (stage.variance_across_views)
      AddVariance(*stage.variance_across_views, "pixels of two views that see one point", &row);
  }
  if constexpr (requires { stage.notices; })
    for (const std::string& notice : stage.notices) row.Add(EscapeHtml(notice));
  return row.html;
}

// See EQ(detail-kept).
const std::string kDetailNote =
    "<p class=note>Detail kept: how much of the photos' fine detail (below about 3 pixels at "
    "the size of the fit) the renders explain, from 0 to 1. Noise does not raise it, "
    "sharpening hardly "
    "does. Sharp: 0.9 or more; soft: below 0.5. A photo blurred by 1 pixel (standard "
    "deviation) "
    "keeps 0.7 to 0.8, by 1.5 pixels 0.3 to 0.6. Its error is the RMS difference of that "
    "detail in levels of 255.</p>";

struct StageLine {
  std::string name;
  RecordedTime time;
  std::string measurements;
};

std::vector<StageLine> StageLines(StagesReport stages) {
  std::vector<StageLine> lines;
  stages.ForEach([&lines](const char* name, const auto& stage) {
    if (stage) lines.push_back({name, stage->time, MeasurementsHtml(*stage)});
  });
  return lines;
}

const char* StageLabel(const std::string& stage) {
  if (stage == "pose") return "camera poses";
  if (stage == "reconstruct") return "reconstruction";
  if (stage == "style_2d") return "2D style";
  if (stage == "stylize") return "style training";
  if (stage == "render") return "rendering";
  return "evaluation";
}

}  // namespace

std::string StagesHtml(const RunReport& report) {
  const std::vector<StageLine> lines = StageLines(report.stages);
  if (lines.empty()) return "";
  double longest = 1e-9;
  for (const StageLine& line : lines) longest = std::max(longest, line.time.seconds);
  std::string body;
  for (const StageLine& line : lines) {
    const double percent = std::clamp(line.time.seconds / longest, 0.0, 1.0) * 100;
    body +=
        Row({Cell(StageLabel(line.name) + ("<br><code class=soft>" + line.name + "</code>")),
             Cell(Duration(line.time.seconds) + "<span class=bar style=\"width:" +
                      FixedNumber(percent, 1) + "%\"></span>",
                  "n"),
             Cell(line.time.cpu_seconds ? Duration(*line.time.cpu_seconds) : MetricHtml({}, 0),
                  "n"),
             Cell(line.measurements, "w")});
  }
  return Heading("Stages") +
         Table("<tr><th>stage<th class=n>time<th class=n>CPU time<th>measurements</tr>", body) +
         "<p class=note>CPU time includes all threads and the programs that a stage started. A "
         "stage that was interrupted counts from its last start.</p>" +
         (report.stages.reconstruct ? kDetailNote + FitChartHtml(*report.stages.reconstruct)
                                    : "") +
         (report.stages.stylize ? BoundChartHtml(*report.stages.stylize) : "");
}

}  // namespace regrade
