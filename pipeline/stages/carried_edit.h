// An edit of single photos in other views: what their layers add to the 2D method's pictures,
// on the surfaces that these photos see. With it a styled scene is compared with what was asked
// for, and not with pictures that lack the edit.
#pragma once

#include <string>
#include <vector>

#include "evaluate/frame_source.h"
#include "kernels/render/field_renderer.h"
#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/run/residual_choice.h"

namespace regrade {

// The layer of each view of `views`, at the size of its camera, in [-1, 1]; empty pictures
// where a photo has none. Throws Error(kInput).
std::vector<Image> LayersOf(const ResidualChoice& choice, const WorkingViews& views);

// A layer as renders take it. What is darkened keeps its proportion, as under less light (see
// EQ(view-scale)): where a render is lighter or darker than the picture that was edited, by a
// voxel or by detail that it does not have, a difference would stay as large as it was on a
// surface that is darker now. What is lightened is added.
class RenderedEdit {
 public:
  RenderedEdit() = default;
  // Of [H, W, 3]. `before`: the 2D method's picture of what was edited; where it is not known,
  // an empty picture, and all of the layer is added.
  RenderedEdit(const Image& before, const Image& layer);

  bool empty() const { return added_.empty(); }
  // Of a pixel, for c in 0 to 2: value * kept + added.
  const float* kept(int x, int y) const { return kept_.at(x, y); }
  const float* added(int x, int y) const { return added_.at(x, y); }
  // The 2D method's picture of a render of the photo's view, with the edit; in [0, 1].
  Image On(Image picture) const;

 private:
  Image kept_, added_;
};

// Of each view of `views`; empty where its photo has no layer. What was edited is told by the
// pictures with the edit, the folder retouched/ beside that of the layers. Throws
// Error(kInput).
std::vector<RenderedEdit> EditsOf(const ResidualChoice& choice, const WorkingViews& views);

class CarriedEdit {
 public:
  // `views` in the frame of `source`, the unstyled field, whose depth at the photos with a
  // layer says what they see. Without layers nothing is rendered.
  CarriedEdit(const ResidualChoice& choice, const WorkingViews& views,
              const FieldRenderer& source);

  bool empty() const { return photos_.empty(); }

  // Puts the edits onto `picture`, the 2D method's [H, W, 3] of a render of `camera` with the
  // depth of RenderedView. Where several photos see a surface, their mean is taken. Returns
  // [H, W, 1]: 1 where such a photo sees the surface, else 0, where nothing was added.
  Image AddTo(const Camera& camera, const Image& depth, Image* picture) const;

 private:
  struct Photo {
    Camera camera;
    RenderedEdit edit;
    Image depth;
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
