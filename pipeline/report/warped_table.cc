// The table of frames compared after forward warping.
#include "pipeline/report/html_table.h"
#include "pipeline/report/html_text.h"
#include "pipeline/report/sequence_names.h"
#include "pipeline/report/tables.h"

namespace regrade {

std::string WarpedHtml(const RunReport& report) {
  if (!report.evaluation.warped) return "";
  std::string body;
  for (const WarpedMetrics& row : *report.evaluation.warped)
    body += Row({Text(SequenceLabel(row.sequence)), Cell(std::to_string(row.gap), "n"),
                 Cell(std::to_string(row.pairs), "n"), Number(row.rmse_published, 4),
                 Number(Metric(row.lpips_published), 4), Number(row.rmse, 4),
                 Number(Metric(row.lpips), 4), Number(row.coverage, 2)});
  return Heading("Consistency after forward warping") +
         "<p>Lower is better. Published: motion of the measured frames, mean over all pixels; "
         "a "
         "pixel that nothing moves to lowers it. Corrected: motion of the unstyled frames, "
         "mean "
         "over the pixels that something moves to.</p>" +
         Table(
             "<tr><th>sequence<th class=n>gap<th class=n>pairs<th class=n>RMSE, "
             "published<th class=n>LPIPS, published<th class=n>RMSE, corrected<th "
             "class=n>LPIPS, corrected<th class=n>coverage</tr>",
             body);
}

}  // namespace regrade
