// The part of a field that cameras see.
#pragma once

#include <string>
#include <vector>

#include "pipeline/fields/field_file.h"

namespace regrade {

// Of a field of splats those in the picture of one of the cameras, which are in the field's
// frame: pictures of them have the same bits as those of the whole field. Memory: see
// ReadPartOfField.
StoredField ReadSeenField(const std::string& path, const std::vector<Camera>& cameras);

}  // namespace regrade
