// The part of a field that cameras see.
#pragma once

#include <string>
#include <vector>

#include "pipeline/fields/field_file.h"

namespace regrade {

// `geometry`: what ReadFieldGeometry read of the file `path`; of splats it may be empty.
// Returns of splats, with their colours, those in the picture of one of the cameras, which are
// in the field's frame: their pictures have the same bits as those of the whole field. Memory:
// see ReadPartOfField. Voxels are whole already.
StoredField SeenPart(StoredField geometry, const std::string& path,
                     const std::vector<Camera>& cameras);

}  // namespace regrade
