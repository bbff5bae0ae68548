// train_filenames, test_filenames and val_filenames of nerfstudio's transforms.json: which
// photos are measured and not fitted.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>

#include "pipeline/files/json_file.h"

namespace regrade {

struct TransformsSplit {
  std::optional<std::set<std::string>> train;  // where the file has such a list
  std::set<std::string> test;                  // for tests, or else for validation
  std::set<std::string> validation;

  // Whether a photo is neither for training nor for tests.
  bool IsLeft(const std::string& file) const;
};

// `file_of`: a frame's picture by the name that the frame has; empty where it is missing.
// Throws Error(kInput) with the place for a list that is none, a name that no frame has, and a
// photo that is for training and for tests.
TransformsSplit ReadTransformsSplit(const std::string& path, const JsonValue& top,
                                    const std::map<std::string, std::string>& file_of);

}  // namespace regrade
