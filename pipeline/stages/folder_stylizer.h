// A 2D method that has been at work already: pictures in a folder, by the names of the photos.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "stylize/image/view_stylizer.h"

namespace regrade {

// `photos` are the views' files as the user named them. A picture belongs to the photo with the
// same name less folder and extension (notes that an editor leaves beside it, IMG_1.xmp, are
// passed over); views without one are not known, so a single retouched
// photo is enough. Each picture is brought to its view's size (area mean or bilinear) when it
// is asked for; its sides must have the same ratio, to a pixel of either.
//
// Throws Error(kInput) if the folder is missing, if two pictures or two photos share a name, or
// if no picture belongs to a photo; Stylize throws Error(kInput) for a picture that cannot be
// read and Error(kExternalProgram) for one of another shape.
std::unique_ptr<ViewStylizer> MakeFolderStylizer(const std::string& folder,
                                                 const std::vector<std::string>& photos);

// A styled picture from somewhere else at the size of its view: see above.
Image FittedToView(const Image& styled, const Image& view, const std::string& where);

}  // namespace regrade
