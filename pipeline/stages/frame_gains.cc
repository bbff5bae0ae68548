#include "pipeline/stages/frame_gains.h"

namespace regrade {

PhotoGains FrameGains(const WorkingViews& views, const RenderOptions& options,
                      const std::vector<int>& of) {
  PhotoGains gains;
  if (!options.keep_exposure) return gains;
  for (const int i : of) gains.of_view.push_back(views.Gain(i));
  return gains;
}

FrameSource PutGains(const FrameSource& frames, const PhotoGains& gains) {
  if (gains.of_view.empty()) return frames;
  return {frames.count, [frames, gains](int k) {
            Image frame = frames.frame(k);
            PutGain(gains.Of(k), &frame);
            return frame;
          }};
}

FrameSource UndoGains(const FrameSource& frames, const PhotoGains& gains) {
  if (gains.of_view.empty()) return frames;
  return {frames.count, [frames, gains](int k) {
            Image frame = frames.frame(k);
            PhotoGain gain = gains.Of(k);
            gain.highlights = 0;
            UndoGain(gain, &frame);  // highlights are what cameras clip
            return frame;
          }};
}

}  // namespace regrade
