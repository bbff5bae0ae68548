// The interface between the pipeline and any 2D method that restyles one view at a time.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "kernels/scene/image.h"

namespace regrade {

// Safe to call from one thread at a time.
class ViewStylizer {
 public:
  virtual ~ViewStylizer() = default;

  // Same size and channels in and out, alpha unchanged. Values may leave [0, 1]: they are
  // clipped where 8-bit files are written, and nowhere before. `view_index` identifies the
  // view. Throws Error.
  virtual Image Stylize(const Image& view, int view_index) const = 0;

  // For reports, e.g. "mkl".
  virtual std::string Name() const = 0;

  // False for methods that cannot style a picture of their own making, but only know what was
  // made of the photos: they are asked for views alone, never for renders.
  virtual bool StylesAnything() const { return true; }
  // False for a view that the method has nothing for; it is not asked for it then.
  virtual bool Knows(int view_index) const {
    (void)view_index;
    return true;
  }

  // What a person should know before the first view, one sentence each.
  virtual std::vector<std::string> Notices() const { return {}; }
};

// Pixels with a value that is not finite. Above 1 % of the picture: Error(kInput) naming
// `where`. The few below it leave every loss and every measure.
int64_t CountNotFinite(const Image& image, const std::string& where);

// For tests, what Stylize guarantees of any method: same size and channels, and
// CountNotFinite, which is returned. Throws Error(kExternalProgram) naming `where`.
int64_t CheckStyledView(const Image& view, const Image& styled, const std::string& where);

// For methods that know colours alone. The three channels of a view, grey as R = G = B, clipped
// to [0, 1]; pixels that are not finite become a middle grey, so that they spoil no neighbour.
Image Colors(const Image& view);
// `colors` (three channels) in the view's own channels, with its alpha; a grey view gets the
// mean of the three. Pixels of the view that are not finite stay what they were.
Image WithColors(const Image& view, const Image& colors);

}  // namespace regrade
