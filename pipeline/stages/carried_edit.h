// An edit of single photos in other views: what their layers add to the 2D method's pictures,
// on the surfaces that these photos see. With it a styled scene is compared with what was asked
// for, and not with pictures that lack the edit.
#pragma once

#include <string>
#include <vector>

#include "evaluate/frame_source.h"
#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_renderer.h"
#include "pipeline/run/residual_choice.h"

namespace regrade {

// The layer of each view of `views`, at the size of its camera, in [-1, 1]; empty pictures
// where a photo has none. Throws Error(kInput).
std::vector<Image> LayersOf(const ResidualChoice& choice, const WorkingViews& views);

class CarriedEdit {
 public:
  // `views` in the frame of `source`, the unstyled field, whose depth at the photos with a
  // layer says what they see. Without layers nothing is rendered.
  CarriedEdit(const ResidualChoice& choice, const WorkingViews& views,
              const FieldRenderer& source);

  bool empty() const { return photos_.empty(); }

  // Adds the layers to `picture`, the 2D method's [H, W, 3] of a render of `camera` with the
  // depth of RenderedView. Where several photos see a surface, their mean is added. Returns
  // [H, W, 1]: 1 where such a photo sees the surface, else 0, where nothing was added.
  Image AddTo(const Camera& camera, const Image& depth, Image* picture) const;

 private:
  struct Photo {
    Camera camera;
    Image layer, depth;
  };
  std::vector<Photo> photos_;
};

// `frames` without the pixels that are 0 in `edited`, the pictures that AddTo returned: NaN,
// which no metric of fidelity counts.
FrameSource WhereEdited(const FrameSource& frames, const FrameSource& edited);

// The mean of all pixels of all pictures.
double MeanOfPictures(const FrameSource& pictures);

// A photo's picture in 2D with its layer, at the style's strength.
Image WithLayer(Image picture, const Image& layer, double strength);

}  // namespace regrade
