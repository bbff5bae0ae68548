#include "pipeline/report/photos.h"

#include "pipeline/report/html_text.h"

namespace regrade {
namespace {

const ReportPicture* ThumbnailOf(const ReportPictures& pictures, size_t photo) {
  if (photo >= pictures.thumbnails.size() || !pictures.thumbnails[photo]) return nullptr;
  return &*pictures.thumbnails[photo];
}

std::string ThumbnailHtml(const ReportPicture* picture) {
  if (picture == nullptr) return "";
  return "<img class=thumb alt=\"\" loading=lazy width=" + std::to_string(picture->width) +
         " height=" + std::to_string(picture->height) + " src=\"" + DataUrl(*picture) + "\">";
}

// The status is a class of the style sheet, too.
std::string StatusHtml(PhotoState status) {
  const std::string text = ToString(status);
  return "<span class=" + text + ">" + text + "</span>";
}

// A photo that is not used, or has a remark.
std::string RemarkRow(const PhotoStatus& photo, const ReportPicture* thumbnail) {
  return "<tr><td>" + ThumbnailHtml(thumbnail) + "<td class=file>" + EscapeHtml(photo.file) +
         "<td>" + StatusHtml(photo.status) + "<td class=w>" + EscapeHtml(photo.why) + "</tr>";
}

}  // namespace

std::string PhotosHtml(const RunReport& report, const ReportPictures& pictures) {
  if (!report.photos) return "";
  const PhotosReport& photos = *report.photos;
  std::string remarks, used, names;
  for (size_t i = 0; i < photos.statuses.size(); ++i) {
    const PhotoStatus& photo = photos.statuses[i];
    const ReportPicture* thumbnail = ThumbnailOf(pictures, i);
    if (photo.status != PhotoState::kUsed || !photo.why.empty())
      remarks += RemarkRow(photo, thumbnail);
    else if (thumbnail != nullptr)
      used += "<figure>" + ThumbnailHtml(thumbnail) + "<figcaption>" + EscapeHtml(photo.file) +
              "</figcaption></figure>";
    else
      names += (names.empty() ? "" : ", ") + EscapeHtml(photo.file);
  }
  std::string html = "<h2>Photos</h2><p>" + std::to_string(photos.given) + " given, " +
                     std::to_string(photos.registered) + " registered, " +
                     std::to_string(photos.used) + " used.</p>" +
                     CameraMapHtml(pictures.cameras);
  if (!remarks.empty())
    html +=
        "<div class=scroll><table><thead><tr><th><th>photo<th>status<th>reason</tr></thead>"
        "<tbody>" +
        remarks + "</tbody></table></div>";
  if (used.empty() && names.empty()) return html;
  html += "<details open><summary>photos used</summary>";
  if (!used.empty()) html += "<div class=thumbs>" + used + "</div>";
  if (!names.empty())
    html += "<p class=note>" + std::string(used.empty() ? "" : "and ") + names + "</p>";
  return html + "</details>";
}

}  // namespace regrade
