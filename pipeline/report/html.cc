#include "pipeline/report/html.h"

#include <algorithm>

#include "pipeline/report/assessment.h"
#include "pipeline/report/costs.h"
#include "pipeline/report/html_text.h"
#include "pipeline/report/page_assets.h"
#include "pipeline/report/photos.h"
#include "pipeline/report/tables.h"

namespace regrade {
namespace {

// The browser enforces it: nothing is fetched but the films beside the page.
constexpr char kPolicy[] =
    "default-src 'none'; img-src data:; media-src 'self' file:; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; base-uri 'none'; form-action 'none'";

// Two pictures side by side; with JavaScript, one over the other with a sliding edge.
std::string CompareHtml(const ReportView& view) {
  const auto& before = view.source ? view.source : view.photo;
  if (!before || !view.styled)
    return PictureHtml(view.styled ? view.styled : before, view.name);
  // As wide as possible without being taller than a screen.
  const double aspect =
      static_cast<double>(std::max(1, before->width)) / std::max(1, before->height);
  return "<div class=compare style=\"--fit:calc(min(80vh, 42rem) * " + FixedNumber(aspect, 3) +
         ")\">" + PictureHtml(before, view.source ? "before" : "photo") +
         PictureHtml(view.styled, "styled") +
         "<input type=range min=0 max=100 step=0.1 value=50 aria-label=\"fraction of the "
         "picture "
         "before styling\"></div>";
}

std::string FilmHtml(const ReportFilm& film) {
  return "<figure><video controls loop muted playsinline preload=metadata src=\"" +
         EscapeHtml(film.file) + "\"" +
         (film.poster ? " poster=\"" + DataUrl(*film.poster) + "\"" : "") +
         "></video><figcaption>" + EscapeHtml(film.caption) + ", <code>" +
         EscapeHtml(film.file) + "</code></figcaption></figure>";
}

// The first film, large.
std::string MainFilmHtml(const ReportPictures& pictures) {
  if (pictures.films.empty()) return "";
  return "<div class=mainfilm>" + FilmHtml(pictures.films[0]) + "</div>";
}

std::string OtherFilmsHtml(const ReportPictures& pictures) {
  if (pictures.films.size() < 2) return "";
  std::string html = "<h2>Other films</h2><div class=films>";
  for (size_t i = 1; i < pictures.films.size(); ++i) html += FilmHtml(pictures.films[i]);
  return html + "</div>";
}

// How it went, for the page of a run.
std::string AssessmentHtml(const RunReport& report) {
  if (!report.stages.reconstruct || report.evaluation.consistency.empty()) return "";
  const Assessment assessment = AssessmentOf(report);
  std::string items;
  for (const std::string& sentence : assessment.sentences)
    items += "<li>" + EscapeHtml(sentence) + "</li>";
  return "<ul class=assessment>" + items +
         "</ul><p class=note>What to do next: " + EscapeHtml(assessment.advice) + ".</p>";
}

std::string ViewsHtml(const ReportPictures& pictures) {
  std::string html;
  for (const ReportView& view : pictures.views) {
    const std::string row = PictureHtml(view.photo, "photo") +
                            PictureHtml(view.source, "reconstruction") +
                            PictureHtml(view.views_2d, "2D method on the reconstruction") +
                            PictureHtml(view.styled, "styled scene");
    if (!row.empty()) {
      html += "<div><div class=view>" + row + "</div><p class=note>" + EscapeHtml(view.name) +
              "</p></div>";
    }
  }
  if (html.empty() && !pictures.style) return "";
  html = "<h2>Views</h2><div class=views>" + html + "</div>";
  if (pictures.style) {
    html += "<details><summary>style picture</summary><div class=view>" +
            PictureHtml(pictures.style, "style") + "</div></details>";
  }
  return html;
}

std::string HeatMapsHtml(const ReportPictures& pictures) {
  std::string html;
  for (const ReportHeatMap& map : pictures.heat_maps)
    html += PictureHtml(map.picture, map.caption);
  if (html.empty()) return "";
  return "<h2>Largest errors</h2><p class=note>The two frames that agree least, of each "
         "sequence "
         "and gap. White: the error of the pixel is 50 dB or better; dark red: 10 dB or worse; "
         "dark grey: not compared.</p><div class=view>" +
         html + "</div>";
}

std::string FactsHtml(const RunReport& report) {
  std::string facts = "regrade " + EscapeHtml(report.version);
  if (!report.preset.empty()) facts += " · preset " + EscapeHtml(report.preset);
  if (!report.device.empty()) facts += " · device " + EscapeHtml(report.device);
  facts += " · " + Duration(report.seconds);
  if (report.peak_memory_mb.value)
    facts += " · peak memory " + FixedNumber(*report.peak_memory_mb.value, 0) + " MB";
  return "<p class=facts>" + facts + "</p>";
}

}  // namespace

std::string ReportHtml(const RunReport& report, const ReportPictures& pictures) {
  const std::string title = EscapeHtml(pictures.title.empty() ? "regrade" : pictures.title);
  const ReportView* headline =
      pictures.views.empty() ? nullptr : &pictures.views[pictures.views.size() / 2];
  std::string html =
      "<!doctype html>\n<html lang=en><head><meta charset=utf-8>"
      "<meta name=viewport content=\"width=device-width,initial-scale=1\">"
      "<meta http-equiv=Content-Security-Policy content=\"" +
      std::string(kPolicy) +
      "\">"
      "<title>" +
      title + " · regrade report</title><style>" + kReportCss +
      "</style></head>\n<body><script>" + kReportScript + "</script><main>\n<header><h1>" +
      title + "</h1>" + FactsHtml(report) + "</header>\n";
  if (!pictures.scene_page.empty())
    html += "<p><a href=\"" + EscapeHtml(pictures.scene_page) +
            "\">Walk through the scene</a> in this browser</p>";
  html += AssessmentHtml(report) + MainFilmHtml(pictures);
  if (headline) html += "<section>" + CompareHtml(*headline) + "</section>";
  for (const std::string& section :
       {HeadlineMetricsHtml(report), OtherFilmsHtml(pictures), ViewsHtml(pictures),
        WarpedHtml(report), ConsistencyHtml(report), HeatMapsHtml(pictures), StagesHtml(report),
        CostsHtml(report), EffectsHtml(report), PhotosHtml(report, pictures),
        RepeatHtml(report, pictures.run_json)}) {
    if (!section.empty()) html += "<section>" + section + "</section>\n";
  }
  return html + "</main></body></html>\n";
}

}  // namespace regrade
