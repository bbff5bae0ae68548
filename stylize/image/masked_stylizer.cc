#include "stylize/image/masked_stylizer.h"

#include <algorithm>
#include <utility>

#include "kernels/base/error.h"

namespace regrade {
namespace {

class MaskedStylizer : public ViewStylizer {
 public:
  MaskedStylizer(std::vector<std::unique_ptr<ViewStylizer>> regions, bool alpha_tells,
                 CoverageFunction coverage, std::vector<std::string> notices)
      : regions_(std::move(regions)),
        alpha_tells_(alpha_tells),
        coverage_(std::move(coverage)),
        notices_(std::move(notices)) {
    REGRADE_CHECK(!regions_.empty());
  }

  Image Stylize(const Image& view, int view_index) const override {
    const std::vector<Image> coverage = coverage_(view, view_index);
    REGRADE_CHECK_EQ(coverage.size(), regions_.size());
    Image result = view;
    for (size_t k = 0; k < regions_.size(); ++k) {
      REGRADE_CHECK(coverage[k].SameSize(view) && coverage[k].channels == 1);
      if (!ShowsRegion(coverage[k])) continue;
      const Image styled =
          regions_[k]->Stylize(alpha_tells_ ? WithRegion(view, coverage[k]) : view, view_index);
      for (int64_t i = 0; i < view.num_pixels(); ++i) {
        const float m = coverage[k].pixels[i];
        if (!(m > 0)) continue;
        for (int c = 0; c < std::min(3, view.channels); ++c) {
          const size_t at = static_cast<size_t>(i * view.channels + c);
          result.pixels[at] += m * (styled.pixels[i * styled.channels + c] - view.pixels[at]);
        }
      }
    }
    return result;
  }

  std::string Name() const override { return regions_[0]->Name(); }
  bool StylesAnything() const override { return regions_[0]->StylesAnything(); }
  bool Knows(int view_index) const override { return regions_[0]->Knows(view_index); }
  std::vector<std::string> Notices() const override {
    std::vector<std::string> notices = notices_;
    for (const auto& region : regions_)
      for (const std::string& notice : region->Notices())
        if (std::ranges::find(notices, notice) == notices.end()) notices.push_back(notice);
    return notices;
  }

 private:
  std::vector<std::unique_ptr<ViewStylizer>> regions_;
  bool alpha_tells_;
  CoverageFunction coverage_;
  std::vector<std::string> notices_;
};

}  // namespace

Image WithRegion(const Image& view, const Image& coverage) {
  REGRADE_CHECK(view.SameSize(coverage) && coverage.channels == 1);
  Image result(view.width, view.height, 4);
  for (int64_t i = 0; i < view.num_pixels(); ++i) {
    const float* p = &view.pixels[i * view.channels];
    float* q = &result.pixels[4 * i];
    for (int c = 0; c < 3; ++c) q[c] = p[view.channels < 3 ? 0 : c];
    q[3] = coverage.pixels[i] > 0.5f ? 1.0f : 0.0f;
  }
  return result;
}

bool ShowsRegion(const Image& coverage) {
  return std::ranges::any_of(coverage.pixels, [](float m) { return m > 0.5f; });
}

std::unique_ptr<ViewStylizer> MakeMaskedStylizer(
    std::vector<std::unique_ptr<ViewStylizer>> regions, bool alpha_tells,
    CoverageFunction coverage, std::vector<std::string> notices) {
  return std::make_unique<MaskedStylizer>(std::move(regions), alpha_tells, std::move(coverage),
                                          std::move(notices));
}

}  // namespace regrade
