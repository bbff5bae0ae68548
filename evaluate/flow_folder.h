// A folder of flow files, by the frames in their names.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "evaluate/flow_field.h"

namespace regrade {

// The files NAME_FROM_TO.flo of a folder, whatever their prefix and the zeros of their numbers.
class FlowFolder {
 public:
  // `frames`: what the files call frame 0, 1, ...; empty: 0, 1, ... A folder that does not
  // exist has no files. Throws Error(kInput) for two files of the same pair, unless one of them
  // is named as FlowFileName has it.
  explicit FlowFolder(const std::string& folder, const std::vector<int64_t>& frames = {});

  bool Has(int i, int j) const;

  // The motion from frame i to frame j, of this size. Throws Error(kInput): no file, another
  // size, or a damaged one.
  FlowField Read(int i, int j, int width, int height) const;

  // The least number of a frame in the names; -1 without files.
  int64_t LeastFrame() const;

 private:
  int64_t Called(int frame) const;

  std::string folder_;
  std::vector<int64_t> frames_;
  std::map<std::pair<int64_t, int64_t>, std::string> files_;
};

}  // namespace regrade
