// Encoded pictures embedded in a page.
#pragma once

#include <optional>
#include <string>

namespace regrade {

struct ReportPicture {
  std::string bytes;  // of a whole JPEG or PNG file
  int width = 0, height = 0;
};

// "data:image/jpeg;base64,..."
std::string DataUrl(const ReportPicture& picture);

// A <figure> with its caption, which may be hostile; "" without a picture.
std::string PictureHtml(const std::optional<ReportPicture>& picture,
                        const std::string& caption);

}  // namespace regrade
