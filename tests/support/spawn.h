// Starts a program and sends it a signal once a file exists.
#pragma once

#include <string>
#include <vector>

namespace regrade::testing {

// Starts `program` with its output on `fd`; returns its exit status as a shell does. A
// `signal` other than 0 is sent once the file `when` exists, or after a minute.
int Spawn(const char* program, const std::vector<std::string>& arguments, int fd,
          int signal = 0, const std::string& when = "");

}  // namespace regrade::testing
