// What a person did to one photo: one map of colours, what depends on the place, and what
// belongs to the picture and not to the scene.
#pragma once

#include <string>
#include <vector>

#include "kernels/image/color_table.h"
#include "kernels/scene/image.h"
#include "pipeline/stages/photo_vignette.h"

namespace regrade {

struct PhotoEdit {
  ColorTable table;  // the map of colours, 33^3
  bool of_photo =
      false;          // that map is the identity: the layer is the difference from the photo
  Image picture;      // the edit without vignette, sharpening and grain; size of the photo
  Image layer;        // of that, what the map does not carry: [H, W, 3], in [-1, 1]
  double change = 0;  // root mean square of edit - photo, in units of white
  double local = 0;   // of what the map of colours does not explain, without fine detail
  Vignette vignette;  // 1 everywhere where there is none
  double sharpening = 0;  // of the photo's fine detail, added; 0 where there is none
  double grain = 0;       // standard deviation, in units of white
  bool IsLocal() const;   // does the place matter beyond the colour?
};

// EQ(photo-edit): the edit e of the photo p is taken as
//   e(x) = g(|x|) (T(p(x)) + l(x) + d(x)),
// T a map of colours, see EQ(table-fit), at most 8 times as steep, g = 1 + a r^2 + b r^4 a
// vignette, r the distance from the centre in half diagonals, l what is left below the
// frequency of 1/16 of the longer side, and d what is left above it: sharpening, where it
// follows the photo's own fine detail, and grain. T and g are fitted in turns. A vignette is
// taken for one where it changes the corners by 3 % at least and explains half of what T alone
// leaves below that frequency, and where it changes more from half way to the corner than from
// the centre to half way: a dodged centre does the opposite. The picture is T(p) + l.
//
// Where the edit is local, the layer keeps the photo's own edges, see EQ(guided-filter), and T
// becomes the identity unless it halves the layer's variation: an edit of one object or one
// side is no map of colours, and what is not seen in this photo keeps its colours.
//
// Both have three channels and the same size.
PhotoEdit AnalyseEdit(const Image& photo, const Image& edited);

// What a person should know, one sentence each.
std::vector<std::string> EditNotices(const PhotoEdit& edit, bool keep_vignette = false);

// The edited file at the photo's size. Throws Error(kInput) where it has another shape (to 1 %)
// or where its edges are elsewhere by more than 1.5 pixels, with the pixels and what to do.
Image EditAtPhotoSize(const Image& edited, const Image& photo, const std::string& where);

}  // namespace regrade
