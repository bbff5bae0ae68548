#include "pipeline/program/interrupt.h"

#include <signal.h>

#include <initializer_list>

namespace regrade {
namespace {

volatile sig_atomic_t stop_signal = 0;

constexpr int kStopSignals[] = {SIGINT, SIGTERM, SIGHUP};

void SetAction(int signal, void (*action)(int)) {
  struct sigaction request = {};
  request.sa_handler = action;
  sigemptyset(&request.sa_mask);
  request.sa_flags = SA_RESTART;
  sigaction(signal, &request, nullptr);
}

// Only calls that are allowed in a handler.
void OnStopSignal(int signal) {
  stop_signal = signal;
  for (const int other : kStopSignals) SetAction(other, SIG_DFL);
}

}  // namespace

void InstallSignalHandling() {
  for (const int signal : kStopSignals) {
    struct sigaction old = {};
    sigaction(signal, nullptr, &old);
    if (old.sa_handler == SIG_IGN) continue;  // nohup, or a shell's background job
    SetAction(signal, OnStopSignal);
  }
  for (const int signal : {SIGPIPE, SIGXFSZ}) SetAction(signal, SIG_IGN);
}

int StopSignal() { return stop_signal; }

void DieBySignal(int signal) {
  SetAction(signal, SIG_DFL);
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, signal);
  sigprocmask(SIG_UNBLOCK, &set, nullptr);
  raise(signal);
}

}  // namespace regrade
