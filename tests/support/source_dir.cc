#include "tests/support/source_dir.h"

namespace regrade::testing {

std::string SourceDir() { return REGRADE_SOURCE_DIR; }

}  // namespace regrade::testing
