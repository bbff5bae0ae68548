#include "pipeline/report/tables.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "pipeline/report/chart.h"
#include "pipeline/report/html_table.h"
#include "pipeline/report/html_text.h"
#include "pipeline/report/sequence_names.h"

namespace regrade {
namespace {

// A report without a command is about frames of other programs.
const char* SequenceMeaning(const RunReport& report, const std::string& sequence) {
  if (report.command.empty()) {
    if (sequence == "source") return "the reference frames, which motion and masks come from";
    if (sequence == "views_2d") return "the 2D method applied to each of them";
    if (sequence == "styled") return "the frames under evaluation";
  }
  if (sequence == "source") return "frames of the reconstruction";
  if (sequence == "views_2d") return "the 2D method applied to each of those frames";
  if (sequence == "styled") return "frames of the restyled reconstruction";
  return "";
}

std::string IntervalHtml(const ConsistencyMetrics& row) {
  if (!row.tc_psnr_low_db.value || !row.tc_psnr_high_db.value)
    return MetricHtml(row.tc_psnr_low_db, 2);
  return MetricHtml(row.tc_psnr_low_db, 2) + "–" + MetricHtml(row.tc_psnr_high_db, 2);
}

// The sequence's own value, and that of the 2D method's frames in parentheses.
std::string WithTarget(const Metric& value, const Metric& target, int decimals) {
  std::string html = MetricHtml(value, decimals);
  if (target.value) html += " <span class=soft>(" + MetricHtml(target, decimals) + ")</span>";
  return html;
}

const ConsistencyMetrics* ShortestGap(const EvaluationMetrics& metrics,
                                      const std::string& sequence) {
  const ConsistencyMetrics* best = nullptr;
  for (const auto& row : metrics.consistency) {
    if (row.sequence == sequence && (best == nullptr || row.gap < best->gap)) best = &row;
  }
  return best;
}

}  // namespace

std::string HeadlineMetricsHtml(const RunReport& report) {
  std::string html;
  const auto card = [&](const std::string& name, const std::string& value) {
    html += "<div><dt>" + name + "</dt><dd>" + value + "</dd></div>";
  };
  // A scene without photos has neither of the two.
  if (const auto& s = report.stages.reconstruct;
      s && (s->psnr_train_db.value || s->psnr_heldout_db.value)) {
    std::string value = MetricHtml(s->psnr_heldout_db, 2, "<small>dB</small>");
    if (s->ssim_heldout.value)
      value += " <small>SSIM " + MetricHtml(s->ssim_heldout, 3) + "</small>";
    if (const auto& evaluate = report.stages.evaluate; evaluate && evaluate->lpips_heldout)
      value += " <small>LPIPS " + MetricHtml(*evaluate->lpips_heldout, 3) + "</small>";
    card("reconstruction quality (PSNR on held-out photos)", value);
    const bool held_out = s->detail_kept_heldout.value.has_value();
    const Metric& kept = held_out ? s->detail_kept_heldout : s->detail_kept_train;
    card(std::string("sharpness of the reconstruction (detail kept of the ") +
             (held_out ? "held-out" : "training") + " photos)",
         s->sharpness.empty()
             ? MetricHtml(kept, 2)
             : EscapeHtml(s->sharpness) + " <small>" + MetricHtml(kept, 2) + " of 1</small>");
  }
  const EvaluationMetrics& evaluation = report.evaluation;
  const ConsistencyMetrics* styled = ShortestGap(evaluation, "styled");
  const ConsistencyMetrics* views_2d = ShortestGap(evaluation, "views_2d");
  if (styled != nullptr) {
    std::string value = MetricHtml(styled->tc_psnr_mean_db, 2, "<small>dB</small>");
    if (views_2d != nullptr && views_2d->gap == styled->gap)
      value += " <small>2D method frame by frame: " +
               MetricHtml(views_2d->tc_psnr_mean_db, 2, "dB") + "</small>";
    card("consistency of the styled frames (TC-PSNR)", value);
  }
  // Consistency is never shown without fidelity.
  const auto fidelity =
      std::find_if(evaluation.fidelity.begin(), evaluation.fidelity.end(),
                   [](const FidelityRow& row) { return row.sequence == "styled"; });
  if (fidelity != evaluation.fidelity.end()) {
    card("fidelity to the 2D method (PSNR)",
         MetricHtml(Metric(fidelity->psnr_to_2d_db), 2, "<small>dB</small>"));
  } else if (styled != nullptr) {
    card("fidelity to the 2D method (PSNR)", MetricHtml(Metric(), 2));
  }
  if (html.empty() && !report.costs.empty()) return "";  // a cost table alone
  card("total time", Duration(report.seconds));
  return "<dl class=cards>" + html + "</dl>";
}

std::string ConsistencyHtml(const RunReport& report) {
  std::vector<std::string> sequences;  // in order of appearance
  const auto add = [&](const std::string& name) {
    if (std::find(sequences.begin(), sequences.end(), name) == sequences.end())
      sequences.push_back(name);
  };
  for (const auto& row : report.evaluation.consistency) add(row.sequence);
  for (const auto& row : report.evaluation.fidelity) add(row.sequence);
  if (sequences.empty()) return "";

  std::string body, meanings;
  for (const std::string& sequence : sequences) {
    std::vector<const ConsistencyMetrics*> rows;
    for (const auto& row : report.evaluation.consistency) {
      if (row.sequence == sequence) rows.push_back(&row);
    }
    const FidelityRow* fidelity = nullptr;
    for (const auto& row : report.evaluation.fidelity) {
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
        body += "<th scope=row rowspan=" + std::to_string(n) + ">" +
                EscapeHtml(SequenceLabel(sequence)) + "</th>";
      body += Cell(measured ? std::to_string(row.gap) : "–", "n") +
              Number(row.tc_psnr_mean_db, 2) + Cell(IntervalHtml(row), "n") +
              Number(row.tc_psnr_of_mean_db, 2) + Cell(pairs, "n") + Number(row.coverage, 2);
      if (i == 0) {
        const auto metric = [&](std::optional<double> FidelityRow::*member) {
          return fidelity == nullptr ? Metric() : Metric(fidelity->*member);
        };
        std::string to_2d = MetricHtml(metric(&FidelityRow::psnr_to_2d_db), 2);
        for (const auto& [name, member] : {std::pair{"LPIPS ", &FidelityRow::lpips_to_2d},
                                           {"structure ", &FidelityRow::structure},
                                           {"edge SSIM ", &FidelityRow::edge_ssim}})
          if (fidelity != nullptr && fidelity->*member)
            to_2d += std::string("<br>") + name + MetricHtml(metric(member), 3);
        body +=
            SpanningCell(to_2d, n, "n divider") +
            SpanningCell(
                WithTarget(metric(&FidelityRow::hue_std), metric(&FidelityRow::hue_std_2d), 3),
                n, "n") +
            SpanningCell(
                WithTarget(metric(&FidelityRow::chroma), metric(&FidelityRow::chroma_2d), 1), n,
                "n") +
            SpanningCell(MetricHtml(metric(&FidelityRow::sliced_wasserstein_to_style), 4), n,
                         "n");
      }
      body += "</tr>";
    }
    const std::string meaning = SequenceMeaning(report, sequence);
    if (!meaning.empty())
      meanings += "<b>" + EscapeHtml(SequenceLabel(sequence)) + "</b> (<code>" +
                  EscapeHtml(sequence) + "</code>): " + meaning + ". ";
  }
  const std::string head =
      "<tr><th rowspan=2>sequence<th colspan=6>consistency<th class=divider "
      "colspan=4>fidelity</tr>"
      "<tr><th class=n>gap<th class=n>TC-PSNR, dB<th class=n>95&nbsp;% interval<th class=n>of "
      "mean error, dB<th class=n>pairs<th class=n>coverage"
      "<th class=\"n divider\">PSNR to 2D, dB<th class=n>hue spread (2D)<th class=n>chroma (2D)"
      "<th class=n>distance to style</tr>";
  const std::string& note =
      report.stages.evaluate ? report.stages.evaluate->comparison_note : std::string();
  return Heading("Consistency and fidelity") +
         "<p>Consistency: how well frames agree after the motion between them is undone. "
         "Fidelity: how close their colours are to the 2D method's. A grey or blurred film is "
         "consistent, too, so read both.</p>" +
         (note.empty() ? "" : "<p class=note>In this capture " + EscapeHtml(note) + ".</p>") +
         Table(head, body) + "<p class=note>" + meanings +
         "In parentheses: the 2D method's frames. Gap: distance of the compared frames. "
         "Coverage: fraction of the pixels that was compared. Structure: correlation of edges "
         "with the unstyled frames, 1 where they are unchanged. 95 % interval: block bootstrap "
         "over pairs, 1000 resamples, blocks as long as the gap because such pairs "
         "overlap.</p>" +
         ConsistencyChartHtml(report.evaluation);
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
  return Heading("Scene decisions") +
         "<p>Each correction is used only where the capture needs it. <code>--effects "
         "NAME=on</code> or <code>NAME=off</code> overrides a decision.</p>" +
         Table(
             "<tr><th>correction<th><th class=n>measured<th class=n>threshold<th>evidence</tr>",
             body);
}

std::string RepeatHtml(const RunReport& report, const std::string& run_json) {
  if (report.command.empty()) return "";
  std::string html = Heading("Repeat this run") + "<pre>" +
                     EscapeHtml(ShellCommand(report.command)) +
                     "</pre><p>or, with exactly the same options,</p><pre>regrade run --config "
                     "run.json --out again</pre><p>regrade " +
                     EscapeHtml(report.version) + ", seed " + std::to_string(report.seed) +
                     ". All numbers on this page are in <code>report.json</code>.</p>";
  std::string versions, options;
  for (const OptionValue& version : report.versions)
    versions += Row({Text(version.name), Text(version.value, "w")});
  for (const OptionValue& option : report.options)
    options +=
        Row({Cell("<code>" + EscapeHtml(option.name) + "</code>"), Text(option.value, "w")});
  if (!versions.empty()) html += Table("<tr><th>component<th>version</tr>", versions);
  if (!options.empty())
    html += "<details><summary>options</summary>" +
            Table("<tr><th>option<th>value</tr>", options) + "</details>";
  if (!run_json.empty())
    html +=
        "<details><summary>run.json</summary><pre>" + EscapeHtml(run_json) + "</pre></details>";
  return html;
}

}  // namespace regrade
