#include "kernels/process/program_module.h"

#include <dlfcn.h>

#include <new>

#include "kernels/base/error.h"

namespace regrade {

void* ModuleFunction(const std::string& name, const char* function) {
  const std::string file = "regrade_" + name + ".so";
  // RTLD_NOW: what is missing is found here, not in the middle of a decoder.
  void* const module = ::dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  void* const found = module == nullptr ? nullptr : ::dlsym(module, function);
  if (found != nullptr) return found;
  const char* const said = ::dlerror();
  const std::string why = said == nullptr ? "unknown reason" : said;
  for (const char* sign : {"failed to map", "cannot allocate", "Cannot allocate"})
    if (why.find(sign) != why.npos) throw std::bad_alloc();
  throw ResourceError("cannot load a part of this program: " + why, file,
                      "install or build regrade again");
}

}  // namespace regrade
