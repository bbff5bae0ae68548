#include "kernels/scene/photo_status.h"

#include <algorithm>

namespace regrade {

const char* ToString(PhotoState state) {
  switch (state) {
    case PhotoState::kUsed:
      return "used";
    case PhotoState::kSkipped:
      return "skipped";
    case PhotoState::kUnregistered:
      return "unregistered";
  }
  return "";
}

std::optional<PhotoState> PhotoStateOf(std::string_view text) {
  for (const PhotoState state :
       {PhotoState::kUsed, PhotoState::kSkipped, PhotoState::kUnregistered})
    if (text == ToString(state)) return state;
  return std::nullopt;
}

std::vector<PhotoStatus> MergeStatuses(std::vector<PhotoStatus> earlier,
                                       const std::vector<PhotoStatus>& later) {
  for (const PhotoStatus& photo : later) {
    const auto same = std::ranges::find(earlier, photo.file, &PhotoStatus::file);
    if (same == earlier.end()) {
      earlier.push_back(photo);
      continue;
    }
    same->status = photo.status;
    if (!photo.why.empty()) same->why = photo.why;
  }
  return earlier;
}

}  // namespace regrade
