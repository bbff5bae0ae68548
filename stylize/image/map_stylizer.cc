#include "stylize/image/map_stylizer.h"

#include <utility>

namespace regrade {
namespace {

class MapStylizer : public ViewStylizer {
 public:
  MapStylizer(std::function<Vec3d(const Vec3d&)> map, std::string name,
              std::vector<std::string> notices)
      : map_(std::move(map)), name_(std::move(name)), notices_(std::move(notices)) {}

  Image Stylize(const Image& view, int view_index) const override {
    CountNotFinite(view, "view " + std::to_string(view_index));
    return MapView(view, map_);
  }
  std::string Name() const override { return name_; }
  std::vector<std::string> Notices() const override { return notices_; }

 private:
  std::function<Vec3d(const Vec3d&)> map_;
  std::string name_;
  std::vector<std::string> notices_;
};

}  // namespace

Image MapView(const Image& view, const std::function<Vec3d(const Vec3d&)>& map) {
  Image colors = Colors(view);
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < colors.num_pixels(); ++i) {
    float* p = &colors.pixels[3 * i];
    const Vec3d mapped = map({p[0], p[1], p[2]});
    for (int c = 0; c < 3; ++c) p[c] = static_cast<float>(mapped[c]);
  }
  return WithColors(view, colors);
}

std::unique_ptr<ViewStylizer> MakeMapStylizer(std::function<Vec3d(const Vec3d&)> map,
                                              std::string name,
                                              std::vector<std::string> notices) {
  return std::make_unique<MapStylizer>(std::move(map), std::move(name), std::move(notices));
}

}  // namespace regrade
