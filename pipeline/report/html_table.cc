#include "pipeline/report/html_table.h"

#include "pipeline/report/html_text.h"

namespace regrade {

std::string Heading(const std::string& text) { return "<h2>" + text + "</h2>"; }

std::string Row(const std::vector<std::string>& cells) {
  std::string html = "<tr>";
  for (const std::string& cell : cells) html += cell;
  return html + "</tr>";
}

std::string Cell(const std::string& html, const std::string& classes) {
  return classes.empty() ? "<td>" + html + "</td>"
                         : "<td class=\"" + classes + "\">" + html + "</td>";
}

std::string Number(const Metric& metric, int decimals) {
  return Cell(MetricHtml(metric, decimals), "n");
}

std::string Text(const std::string& text, const std::string& classes) {
  return Cell(EscapeHtml(text), classes);
}

std::string Table(const std::string& head, const std::string& body) {
  return "<div class=scroll><table><thead>" + head + "</thead><tbody>" + body +
         "</tbody></table></div>";
}

std::string SpanningCell(const std::string& html, size_t rows, const std::string& classes) {
  return "<td rowspan=" + std::to_string(rows) + " class=\"" + classes + "\">" + html + "</td>";
}

std::string MetricHtml(const Metric& metric, int decimals, const std::string& unit) {
  if (metric.value)
    return FixedNumber(*metric.value, decimals) + (unit.empty() ? "" : "&nbsp;" + unit);
  return "<span class=none title=\"" + EscapeHtml(metric.why) + "\">–</span>";
}

}  // namespace regrade
