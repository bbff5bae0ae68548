// The page of a study, embedded by CMake from web/.
#pragma once

namespace regrade {

extern const char kStudyTemplate[], kStudyCss[], kStudyScript[];

}  // namespace regrade
