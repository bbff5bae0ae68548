#include "pipeline/report/picture.h"

#include <string_view>

#include "pipeline/report/html_text.h"

namespace regrade {

std::string DataUrl(const ReportPicture& picture) {
  const bool png = std::string_view(picture.bytes).substr(0, 4) == "\x89PNG";
  return std::string("data:image/") + (png ? "png" : "jpeg") + ";base64," +
         Base64(picture.bytes);
}

std::string PictureHtml(const std::optional<ReportPicture>& picture,
                        const std::string& caption) {
  if (!picture) return "";
  std::string size;
  if (picture->width > 0 && picture->height > 0) {
    size = " width=" + std::to_string(picture->width) +
           " height=" + std::to_string(picture->height);
  }
  return "<figure><img alt=\"" + EscapeHtml(caption) + "\"" + size + " src=\"" +
         DataUrl(*picture) + "\"><figcaption>" + EscapeHtml(caption) + "</figcaption></figure>";
}

}  // namespace regrade
