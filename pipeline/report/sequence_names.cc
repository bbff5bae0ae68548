#include "pipeline/report/sequence_names.h"

#include "pipeline/workspace/output_names.h"

namespace regrade {

std::string SequenceLabel(const std::string& sequence) {
  if (sequence.starts_with(kPathPrefix))
    return "film, " + SequenceLabel(sequence.substr(std::string(kPathPrefix).size()));
  if (sequence == "source") return "before styling";
  if (sequence == "views_2d") return "2D method, frame by frame";
  if (sequence == "styled") return "styled scene";
  if (sequence == "photos") return "photos";
  if (sequence == "photos_2d") return "2D method on the photos";
  if (sequence == "control_linear_map") return "control: one linear colour map";
  if (sequence == "control_blurred") return "control: styled, blurred";
  if (sequence == "control_grey") return "control: styled, grey";
  if (sequence == "control_field_2d")
    return "control: field fitted to the 2D method's pictures";
  if (sequence == "control_ceiling")
    return "control: the scene's own colours fitted to the 2D method's pictures";
  return sequence;
}

}  // namespace regrade
