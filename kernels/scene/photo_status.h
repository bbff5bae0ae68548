// What became of each photo that was given.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace regrade {

enum class PhotoState {
  kUsed,
  kSkipped,       // left out before poses, or named by the poses and missing
  kUnregistered,  // without a pose
};

// "used", "skipped", "unregistered": in files, reports and style sheets.
const char* ToString(PhotoState state);
std::optional<PhotoState> PhotoStateOf(std::string_view text);

struct PhotoStatus {
  std::string file;  // the user's name, relative to the given folder
  PhotoState status = PhotoState::kUsed;
  std::string why;  // empty for kUsed, unless there is a remark
};

// `earlier` in its order, with the states of `later` for the same files and their reasons where
// they have one; files of `later` alone follow.
std::vector<PhotoStatus> MergeStatuses(std::vector<PhotoStatus> earlier,
                                       const std::vector<PhotoStatus>& later);

}  // namespace regrade
