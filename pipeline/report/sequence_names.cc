#include "pipeline/report/sequence_names.h"

#include "pipeline/workspace/output_names.h"

namespace regrade {

std::string SequenceLabel(const std::string& sequence) {
  if (sequence.starts_with(kPathPrefix))
    return "film, " + SequenceLabel(sequence.substr(std::string(kPathPrefix).size()));
  if (sequence == "source") return "before styling";
  if (sequence == "views_2d") return "2D method, frame by frame";
  if (sequence == "styled") return "styled scene";
  return sequence;
}

}  // namespace regrade
