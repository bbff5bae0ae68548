// Parses COLMAP's output: progress of a command, and evidence of why photos were not
// registered.
#pragma once

#include <map>
#include <string>

namespace regrade {

struct ColmapEvidence {
  std::map<std::string, int> features;  // by image name, from feature_extractor
  int matched_pairs = -1;  // pairs of photos with verified matches, from mapper; -1: unknown

  int MedianFeatures() const;  // 0 without photos
};

// Parses the output of the commands of one reconstruction, line by line.
class ColmapOutput {
 public:
  // `num_photos`: the total for mapper's count of registered images.
  explicit ColmapOutput(int num_photos) : num_photos_(num_photos) {}

  void StartCommand() { fraction_ = 0; }
  void Line(const std::string& line);

  double fraction() const { return fraction_; }  // of the current command, in [0, 1]
  const ColmapEvidence& evidence() const { return evidence_; }

 private:
  int num_photos_;
  double fraction_ = 0;
  std::string name_;
  ColmapEvidence evidence_;
};

}  // namespace regrade
