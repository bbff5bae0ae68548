// Handles Ctrl-C and similar signals: the current step is finished and saved, then the program
// dies by the same signal, so that a shell sees the reason.
#pragma once

namespace regrade {

// SIGINT, SIGTERM and SIGHUP raise a flag; a second one ends the program at once. SIGPIPE and
// SIGXFSZ are ignored, so that a closed terminal and a file size limit become errors of
// the failed write.
void InstallSignalHandling();

// The signal that requests a stop; 0: none.
int StopSignal();
inline bool StopRequested() { return StopSignal() != 0; }

// Restores the default action and raises the signal; returns only if it is not deadly.
void DieBySignal(int signal);

}  // namespace regrade
