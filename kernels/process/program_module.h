// Parts of the program in files of their own, loaded when they are first needed: the libraries
// that they bring take longer to load than most commands run.
#pragma once

#include <string>

namespace regrade {

// The address of a function in the module "regrade_NAME.so", which the program's run path leads
// to. A module stays loaded. Throws Error(kResources) with the loader's reason, std::bad_alloc
// where memory does not suffice.
void* ModuleFunction(const std::string& name, const char* function);

}  // namespace regrade
