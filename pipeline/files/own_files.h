// Files of a run's folder, which may come from somebody else: what is not a plain file or
// folder there is refused by name, so that nothing is read, written or removed elsewhere, and
// nothing is waited for.
#pragma once

#include <string>

namespace regrade {

// Throws Error(kInput) for a link, a named pipe, a socket or a device at `path`; nothing there
// is fine. kResources where that cannot be found out.
void RefuseForeign(const std::string& path);

// The same of all that is below the folder `path`, too, but for what other programs left in
// private folders (private_folder.h), of which nothing is read: COLMAP's log has links.
void RefuseForeignBelow(const std::string& path);

}  // namespace regrade
