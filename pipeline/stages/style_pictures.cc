#include "pipeline/stages/style_pictures.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "kernels/image/resize.h"
#include "pipeline/images/cube_file.h"
#include "pipeline/workspace/stage_record.h"
#include "pipeline/workspace/style_folders.h"
#include "stylize/image/view_stylizer.h"

namespace regrade {

Image StyleExampleOf(const StyleSource& style, std::string* notice) {
  if (style.pictures.size() <= 1) return StyleExample(style.picture(), notice);
  std::vector<Image> examples;
  int height = 1 << 30, width = 0;
  for (const std::string& path : style.pictures) {
    std::string said;
    examples.push_back(Colors(StyleExample(path, &said)));
    if (notice != nullptr && !said.empty()) *notice += (notice->empty() ? "" : "; ") + said;
    height = std::min(height, examples.back().height);
  }
  for (Image& example : examples) {
    const double scale = static_cast<double>(height) / example.height;
    example = Resize(example, std::max(1, static_cast<int>(std::lround(scale * example.width))),
                     height);
    width += example.width;
  }
  Image all(width, height);
  int left = 0;
  for (const Image& example : examples) {
    for (int y = 0; y < height; ++y)
      std::copy_n(example.at(0, y), 3 * example.width, all.at(left, y));
    left += example.width;
  }
  return all;
}

JsonValue StyleFiles(const StyleSource& style) {
  if (!style.match.On()) return HashFile(style.picture());
  JsonValue files =
      JsonValue::Object{{"pictures", PicturesHash(style.pictures)}, {"match", "regions"}};
  if (const std::string network = style.match.Network(); !network.empty())
    files["network"] = HashFile(network);
  return files;
}

}  // namespace regrade
