// The picture, or pictures, of a style.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/image.h"
#include "pipeline/files/json_file.h"
#include "pipeline/run/run_settings.h"

namespace regrade {

// What a style looks like: its picture or the chart of its LUT; of several, all side by side at
// the height of the lowest. Throws Error(kInput).
Image StyleExampleOf(const StyleSource& style, std::string* notice);

// Hashes of the files that decide a style's 2D pictures: those of its pictures and of the
// network that matches them. Of one picture its hash alone. Throws Error(kInput).
JsonValue StyleFiles(const StyleSource& style);

}  // namespace regrade
