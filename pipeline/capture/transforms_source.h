// Which pictures the transforms.json of a folder takes, and what is said of them.
#pragma once

#include <filesystem>

#include "pipeline/capture/capture_source.h"

namespace regrade {

// Of transforms.json, or of a Blender capture's transforms_train.json with or without
// transforms_test.json; `poses` is empty where there is none. Throws Error(kInput) as
// ReadTransformsJson.
CaptureSource TransformsSource(const std::filesystem::path& root);

}  // namespace regrade
