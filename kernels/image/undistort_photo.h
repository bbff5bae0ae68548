// A photo as a lens without distortion would have taken it.
#pragma once

#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"

namespace regrade {

// The picture of `camera.Undistorted()` from that of `camera`, same size and channels: bicubic
// (Catmull and Rom's spline through the pixels, Keys 1981 with a = -1/2), which keeps more of
// fine detail than bilinear, within the range of the four nearest pixels. NaN where the photo
// does not reach, where the lens folds over, and where one of the 16 pixels is not finite. A
// pinhole's photo is returned as it is.
Image UndistortPhoto(const Image& photo, const Camera& camera);

// Gives pixels that are NaN the colour of the nearest pixel of their row that is not, or of the
// nearest row that has one.
void FillBeyond(Image* photo);

}  // namespace regrade
