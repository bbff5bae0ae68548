// Writes the report page's tables.
#include "pipeline/report/tables.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "pipeline/report/chart.h"
#include "pipeline/report/html_text.h"

namespace regrade {
namespace {

std::string Heading(const std::string& text) { return "<h2>" + text + "</h2>"; }

std::string Row(const std::vector<std::string>& cells) {
  std::string html = "<tr>";
  for (const std::string& cell : cells) html += cell;
  return html + "</tr>";
}

// Cells: of text that is ours or already escaped; of numbers; of a stranger's text.
std::string Cell(const std::string& html, const std::string& classes = "") {
  return classes.empty() ? "<td>" + html + "</td>"
                         : "<td class=\"" + classes + "\">" + html + "</td>";
}
std::string Number(const Metric& metric, int decimals, const std::string& unit = "",
                   bool beside = false) {
  return Cell(MetricHtml(metric, decimals, unit), beside ? "n beside" : "n");
}
std::string Text(const std::string& text, const std::string& classes = "") {
  return Cell(EscapeHtml(text), classes);
}

std::string Table(const std::string& head, const std::string& body) {
  return "<div class=scroll><table><thead>" + head + "</thead><tbody>" + body +
         "</tbody></table></div>";
}

// A report without a command is of frames that any program has made.
const char* SequenceMeaning(const RunReport& report, const std::string& sequence) {
  if (report.command.empty()) {
    if (sequence == "source") return "the frames before styling, which motion comes from";
    if (sequence == "views_2d") return "the 2D method on each of them";
    if (sequence == "styled") return "the frames that are judged";
  }
  if (sequence == "source") return "our renders before styling";
  if (sequence == "views_2d") return "the 2D method on each of those renders";
  if (sequence == "styled") return "the restyled field";
  if (sequence == "photos") return "the photos themselves";
  return "";
}

// A cell that speaks for several rows.
std::string Across(const std::string& html, size_t rows, const std::string& classes) {
  return "<td rowspan=" + std::to_string(rows) + " class=\"" + classes + "\">" + html + "</td>";
}

std::string IntervalHtml(const ConsistencyMetrics& row) {
  if (!row.tc_psnr_low_db.value || !row.tc_psnr_high_db.value)
    return MetricHtml(row.tc_psnr_low_db, 2);
  return MetricHtml(row.tc_psnr_low_db, 2) + "–" + MetricHtml(row.tc_psnr_high_db, 2);
}

// The sequence's own figure with the 2D method's in brackets.
std::string WithTarget(const Metric& value, const Metric& target, int decimals) {
  std::string html = MetricHtml(value, decimals);
  if (target.value) html += " <span class=soft>(" + MetricHtml(target, decimals) + ")</span>";
  return html;
}

const ConsistencyMetrics* ShortestGap(const RunReport& report, const std::string& sequence) {
  const ConsistencyMetrics* best = nullptr;
  for (const auto& row : report.consistency) {
    if (row.sequence == sequence && (best == nullptr || row.gap < best->gap)) best = &row;
  }
  return best;
}

// What there is to say of a stage beside its seconds, as "name value" clauses.
struct StageLine {
  std::string name;
  double seconds;
  std::string said;
};

void Say(std::string& said, const std::string& clause) {
  said += (said.empty() ? "" : " · ") + clause;
}

// How neighbouring pixels came apart, by what the guarantee asks for and they lack.
void SayVariance(const VarianceMetrics& variance, std::string* said) {
  for (const VarianceMetrics::Group& group : variance.groups) {
    if (group.pairs == 0) continue;
    const std::string where = group.name == "clamp"  ? "where a colour is clamped"
                              : group.name == "open" ? "where light passes the scene"
                                                     : "where the theory's premises hold";
    Say(*said, std::to_string(group.above) + " of " + std::to_string(group.pairs) +
                   " pairs of neighbouring pixels " + where +
                   " are further apart than bound times before, at most by " +
                   MetricHtml(group.largest_excess, 3) + "; on the mean " +
                   MetricHtml(group.gain, 2) + " times as far apart as before");
  }
}

std::vector<StageLine> StageLines(const StagesReport& stages) {
  std::vector<StageLine> lines;
  const auto add = [&](const char* name, double seconds) -> std::string& {
    return lines.emplace_back(StageLine{name, seconds, ""}).said;
  };
  if (const auto& s = stages.pose) {
    std::string& said = add("pose", s->seconds);
    Say(said, "reprojection " + MetricHtml(s->reprojection_px, 2, "px"));
    Say(said, std::to_string(s->points) + " points");
    if (s->tracks_seconds)
      Say(said, "looked for under the poses that were given in " +
                    MetricHtml(Metric(*s->tracks_seconds), 1, "s"));
    if (s->models_found != 1) Say(said, std::to_string(s->models_found) + " models found");
  }
  if (const auto& s = stages.reconstruct) {
    std::string& said = add("reconstruct", s->seconds);
    Say(said, std::to_string(s->voxels) + " voxels");
    Say(said, "PSNR train " + MetricHtml(s->psnr_train_db, 2, "dB"));
    Say(said, "held out " + MetricHtml(s->psnr_heldout_db, 2, "dB"));
    Say(said, "SSIM held out " + MetricHtml(s->ssim_heldout, 3));
    if (!s->heldout.empty())
      Say(said, std::to_string(s->heldout.size()) + " photos kept for measuring");
  }
  if (const auto& s = stages.style_2d) {
    std::string& said = add("style_2d", s->seconds);
    Say(said, "method " + EscapeHtml(s->method));
    for (const std::string& notice : s->notices) Say(said, EscapeHtml(notice));
  }
  if (const auto& s = stages.stylize) {
    std::string& said = add("stylize", s->seconds);
    Say(said, std::to_string(s->steps) + " steps");
    Say(said, "PSNR to 2D " + MetricHtml(s->psnr_to_2d_db, 2, "dB"));
    Say(said, "to 2D of the photos " + MetricHtml(s->psnr_to_2d_photos_db, 2, "dB"));
    Say(said,
        "a linear colour map reaches " + MetricHtml(s->linear_map_psnr_to_2d_db, 2, "dB"));
    Say(said, "Lipschitz bound " + MetricHtml(s->bound, 2) + ", largest slope seen " +
                  MetricHtml(s->local_lipschitz_sampled, 2) + ", climbed to " +
                  MetricHtml(s->local_lipschitz_max, 2) + ", estimated from the colours " +
                  MetricHtml(s->k_est, 2));
    for (const std::string& notice : s->notices) Say(said, EscapeHtml(notice));
    if (s->variance) SayVariance(*s->variance, &said);
  }
  if (const auto& s = stages.render) {
    std::string& said = add("render", s->seconds);
    Say(said, std::to_string(s->frames) + " frames");
    if (s->film_width > 0)
      Say(said, "film of " + std::to_string(s->film_width) + " × " +
                    std::to_string(s->film_height) + " px");
    Say(said, MetricHtml(s->frames_per_second, 2, "frames/s"));
  }
  if (const auto& s = stages.evaluate) {
    std::string& said = add("evaluate", s->seconds);
    Say(said, "flow " + EscapeHtml(s->flow));
    Say(said, "mask " + EscapeHtml(s->mask));
  }
  return lines;
}

std::string CpuText(const RunReport& report, const std::string& stage) {
  for (const auto& [name, seconds] : report.cpu_seconds)
    if (name == stage) return Duration(seconds);
  return MetricHtml(Metric(), 0);
}

}  // namespace

std::string MetricHtml(const Metric& metric, int decimals, const std::string& unit) {
  if (metric.value)
    return FixedNumber(*metric.value, decimals) + (unit.empty() ? "" : "&nbsp;" + unit);
  return "<span class=none title=\"" + EscapeHtml(metric.why) + "\">–</span>";
}

std::string HeadlineMetricsHtml(const RunReport& report) {
  std::string html;
  const auto card = [&](const std::string& name, const std::string& value) {
    html += "<div><dt>" + name + "</dt><dd>" + value + "</dd></div>";
  };
  if (const auto& s = report.stages.reconstruct) {
    card("held-out PSNR of the reconstruction",
         MetricHtml(s->psnr_heldout_db, 2, "<small>dB</small>"));
  }
  const ConsistencyMetrics* styled = ShortestGap(report, "styled");
  const ConsistencyMetrics* views_2d = ShortestGap(report, "views_2d");
  if (styled != nullptr) {
    std::string value = MetricHtml(styled->tc_psnr_mean_db, 2, "<small>dB</small>");
    if (views_2d != nullptr && views_2d->gap == styled->gap) {
      value +=
          " <small>frame by frame " + MetricHtml(views_2d->tc_psnr_mean_db, 2) + "</small>";
    }
    card("consistency of the styled film (TC-PSNR)", value);
  }
  // Consistency is never shown without fidelity beside it.
  const auto fidelity =
      std::find_if(report.fidelity.begin(), report.fidelity.end(),
                   [](const FidelityMetrics& row) { return row.sequence == "styled"; });
  if (fidelity != report.fidelity.end()) {
    card("fidelity to the 2D method (PSNR)",
         MetricHtml(fidelity->psnr_to_2d_db, 2, "<small>dB</small>"));
  } else if (styled != nullptr) {
    card("fidelity to the 2D method (PSNR)", MetricHtml(Metric(), 2));
  }
  if (html.empty() && !report.costs.empty()) return "";  // a price list alone
  card("time", Duration(report.seconds));
  return "<dl class=cards>" + html + "</dl>";
}

std::string ConsistencyHtml(const RunReport& report) {
  std::vector<std::string> sequences;  // in order of appearance
  const auto see = [&](const std::string& name) {
    if (std::find(sequences.begin(), sequences.end(), name) == sequences.end())
      sequences.push_back(name);
  };
  for (const auto& row : report.consistency) see(row.sequence);
  for (const auto& row : report.fidelity) see(row.sequence);
  if (sequences.empty()) return "";

  std::string body, meanings;
  for (const std::string& sequence : sequences) {
    std::vector<const ConsistencyMetrics*> rows;
    for (const auto& row : report.consistency) {
      if (row.sequence == sequence) rows.push_back(&row);
    }
    const FidelityMetrics none;
    const FidelityMetrics* fidelity = &none;
    for (const auto& row : report.fidelity) {
      if (row.sequence == sequence) fidelity = &row;
    }
    const ConsistencyMetrics unmeasured;
    if (rows.empty()) rows.push_back(&unmeasured);
    for (size_t i = 0; i < rows.size(); ++i) {
      const ConsistencyMetrics& row = *rows[i];
      const bool measured = &row != &unmeasured;
      std::string pairs = measured ? std::to_string(row.pairs) : "–";
      if (row.undefined_pairs > 0)
        pairs += ", " + std::to_string(row.undefined_pairs) + " undefined";
      const size_t n = rows.size();
      body += "<tr>";
      if (i == 0)
        body +=
            "<th scope=row rowspan=" + std::to_string(n) + ">" + EscapeHtml(sequence) + "</th>";
      body += Cell(measured ? std::to_string(row.gap) : "–", "n") +
              Number(row.tc_psnr_mean_db, 2) + Cell(IntervalHtml(row), "n") +
              Number(row.tc_psnr_of_mean_db, 2) + Cell(pairs, "n") + Number(row.coverage, 2);
      if (i == 0) {
        std::string near_2d = MetricHtml(fidelity->psnr_to_2d_db, 2);
        if (fidelity->lpips_to_2d)
          near_2d += "<br>LPIPS " + MetricHtml(*fidelity->lpips_to_2d, 3);
        if (fidelity->structure)
          near_2d += "<br>structure " + MetricHtml(*fidelity->structure, 3);
        body += Across(near_2d, n, "n beside") +
                Across(WithTarget(fidelity->hue_std, fidelity->hue_std_2d, 3), n, "n") +
                Across(WithTarget(fidelity->chroma, fidelity->chroma_2d, 1), n, "n") +
                Across(MetricHtml(fidelity->sliced_wasserstein_to_style, 4), n, "n");
      }
      body += "</tr>";
    }
    const std::string meaning = SequenceMeaning(report, sequence);
    if (!meaning.empty())
      meanings += (meanings.empty() ? "" : "; ") + EscapeHtml(sequence) + ": " + meaning;
  }
  const std::string head =
      "<tr><th rowspan=2>sequence<th colspan=6>consistency<th class=beside "
      "colspan=4>fidelity</tr>"
      "<tr><th class=n>gap<th class=n>TC-PSNR, dB<th class=n>95&nbsp;%<th class=n>dB of "
      "mean<th class=n>pairs<th "
      "class=n>coverage"
      "<th class=\"n beside\">PSNR to 2D, dB<th class=n>hue spread (2D)<th class=n>chroma (2D)"
      "<th class=n>distance to style</tr>";
  const std::string& note =
      report.stages.evaluate ? report.stages.evaluate->comparison_note : std::string();
  return Heading("Consistency, with fidelity beside it") +
         "<p>A grey film is consistent and a blurred one too, so read both halves of a row: "
         "how well frames agree "
         "along the motion between them, and how much of the 2D method's colour is still "
         "there.</p>" +
         (note.empty() ? "" : "<p class=note>In this capture " + EscapeHtml(note) + ".</p>") +
         Table(head, body) + "<p class=note>" + meanings +
         ". In brackets: the 2D method's own figure. Structure: correlation of "
         "edges with the unstyled frames', 1 where none moved and no noise came. 95 %: block "
         "bootstrap over pairs, 1000 resamples, runs as long as the gap because such pairs "
         "overlap.</p>" +
         ConsistencyChartHtml(report);
}

std::string EffectsHtml(const RunReport& report) {
  if (report.effects.empty()) return "";
  std::string body;
  for (const EffectReport& effect : report.effects) {
    body +=
        Row({Text(effect.name), Cell(effect.on ? "on" : "off", effect.on ? "on" : "soft"),
             effect.value.value ? Number(effect.value, 3) : Text(effect.value.why, "n soft"),
             Number(effect.threshold, 3), Text(effect.evidence, "w")});
  }
  return Heading("Effects that this scene calls for") + "<p>What is off costs nothing.</p>" +
         Table("<tr><th>effect<th><th class=n>measured<th class=n>threshold<th>evidence</tr>",
               body);
}

std::string StagesHtml(const RunReport& report) {
  const std::vector<StageLine> lines = StageLines(report.stages);
  if (lines.empty()) return "";
  double longest = 1e-9;
  for (const StageLine& line : lines) longest = std::max(longest, line.seconds);
  std::string body;
  for (const StageLine& line : lines) {
    const double percent = std::clamp(line.seconds / longest, 0.0, 1.0) * 100;
    body += Row({Cell(line.name),
                 Cell(Duration(line.seconds) + "<span class=bar style=\"width:" +
                          FixedNumber(percent, 1) + "%\"></span>",
                      "n"),
                 Cell(CpuText(report, line.name), "n"), Cell(line.said, "w")});
  }
  return Heading("Stages, and what they cost") +
         Table("<tr><th>stage<th class=n>time<th class=n>CPU time<th>figures</tr>", body) +
         "<p class=note>CPU time is of all threads and of the programs that a stage started; a "
         "stage that was interrupted counts from its last start.</p>" +
         (report.stages.reconstruct ? FitChartHtml(*report.stages.reconstruct) : "") +
         (report.stages.stylize ? BoundChartHtml(*report.stages.stylize) : "");
}

std::string RepeatHtml(const RunReport& report, const std::string& run_json) {
  if (report.command.empty()) return "";
  std::string html = Heading("To repeat this run") + "<pre>" +
                     EscapeHtml(ShellCommand(report.command)) +
                     "</pre><p>or, with every option as it was,</p><pre>regrade run --config "
                     "run.json --out again</pre><p>regrade " +
                     EscapeHtml(report.version) + ", seed " + std::to_string(report.seed) +
                     ". Every number of this page is in <code>report.json</code> in this "
                     "folder.</p>";
  std::string versions, options;
  for (const OptionValue& version : report.versions)
    versions += Row({Text(version.name), Text(version.value, "w")});
  for (const OptionValue& option : report.options)
    options +=
        Row({Cell("<code>" + EscapeHtml(option.name) + "</code>"), Text(option.value, "w")});
  if (!versions.empty()) html += Table("<tr><th>part<th>version</tr>", versions);
  if (!options.empty())
    html += "<details><summary>options in effect</summary>" +
            Table("<tr><th>option<th>value</tr>", options) + "</details>";
  if (!run_json.empty())
    html +=
        "<details><summary>run.json</summary><pre>" + EscapeHtml(run_json) + "</pre></details>";
  return html;
}

}  // namespace regrade
