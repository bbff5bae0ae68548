// Cells, rows and tables of the report page.
#pragma once

#include <string>
#include <vector>

#include "pipeline/workspace/metric.h"

namespace regrade {

std::string Heading(const std::string& text);

// The number, or a dash whose tooltip says why there is none.
std::string MetricHtml(const Metric& metric, int decimals, const std::string& unit = "");

// Cells of trusted or escaped HTML, of numbers, of untrusted text, and one that spans rows.
std::string Cell(const std::string& html, const std::string& classes = "");
std::string Number(const Metric& metric, int decimals);
std::string Text(const std::string& text, const std::string& classes = "");
std::string SpanningCell(const std::string& html, size_t rows, const std::string& classes);

std::string Row(const std::vector<std::string>& cells);
std::string Table(const std::string& head, const std::string& body);

}  // namespace regrade
