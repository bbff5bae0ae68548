#include "pipeline/stages/view_controls.h"

#include "pipeline/stages/control_sequences.h"

namespace regrade {

std::vector<NamedFrameSource> ViewControls::Of(const std::vector<int>& of,
                                               const FrameSource& unstyled,
                                               const FrameSource& views_2d,
                                               const FrameSource& styled,
                                               bool with_photos) const {
  std::vector<NamedFrameSource> controls =
      ControlSequences({unstyled, styled, views_2d, style, one_map});
  if (!with_photos) return controls;
  const int count = static_cast<int>(of.size());
  controls.push_back({"photos", {count, [this, of](int k) {
                                   Image photo = views->Photo(of[k]);
                                   views->LeaveOutMasked(of[k], &photo);
                                   return photo;
                                 }}});
  controls.push_back({"photos_2d", {count, [this, of](int k) { return photo_2d(of[k]); }}});
  return controls;
}

}  // namespace regrade
