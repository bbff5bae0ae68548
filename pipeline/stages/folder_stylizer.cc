#include "pipeline/stages/folder_stylizer.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"
#include "pipeline/capture/photo_names.h"
#include "pipeline/images/image_file.h"

namespace regrade {
namespace {

class FolderStylizer : public ViewStylizer {
 public:
  FolderStylizer(std::vector<std::string> paths, int known)
      : paths_(std::move(paths)), known_(known) {}

  Image Stylize(const Image& view, int view_index) const override {
    REGRADE_CHECK(Knows(view_index));
    const std::string& path = paths_[view_index];
    DecodeLimits limits;
    limits.min_side = 1;
    return WithColors(view, FittedToView(DecodePhoto(path, limits).image, view, path));
  }

  std::string Name() const override { return "folder"; }
  bool StylesAnything() const override { return false; }
  bool Knows(int view_index) const override {
    const size_t i = static_cast<size_t>(view_index);
    return i < paths_.size() && !paths_[i].empty();
  }
  std::vector<std::string> Notices() const override {
    const int all = static_cast<int>(paths_.size());
    if (known_ == all) return {};
    return {Concat(known_, " of ", all,
                   " views have a styled picture; the style is learned from these")};
  }

 private:
  std::vector<std::string> paths_;  // one for each view; empty where there is none
  int known_;
};

}  // namespace

Image FittedToView(const Image& styled, const Image& view, const std::string& where) {
  CheckAspect(styled, view.width, view.height, where, ExitCode::kExternalProgram);
  const Image colors = Colors(styled);
  return colors.SameSize(view) ? colors : Resize(colors, view.width, view.height);
}

std::unique_ptr<ViewStylizer> MakeFolderStylizer(const std::string& folder,
                                                 const std::vector<std::string>& photos) {
  std::vector<std::string> paths = PicturesByPhotoName(folder, photos, "picture");
  const int known = static_cast<int>(
      std::ranges::count_if(paths, [](const std::string& path) { return !path.empty(); }));
  return std::make_unique<FolderStylizer>(std::move(paths), known);
}

}  // namespace regrade
