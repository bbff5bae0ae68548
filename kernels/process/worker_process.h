// A program of ours that answers one request after the other, until it ends or is ended.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace regrade {

// The program gets a socket as its standard input, /dev/null as its outputs, no other file, and
// the environment of this process. It is in a process group of its own, so that a signal from
// the terminal does not reach it. Unlike RunChild's programs it is trusted to end by itself
// when the socket is closed, as it is when this process dies; the destructor does not wait for
// that and kills it.
class WorkerProcess {
 public:
  // argv[0] is a path or a name on PATH. Throws Error(kExternalProgram) if it cannot be
  // started, Error(kResources) if processes or files run out.
  explicit WorkerProcess(const std::vector<std::string>& argv);
  ~WorkerProcess();
  WorkerProcess(const WorkerProcess&) = delete;
  WorkerProcess& operator=(const WorkerProcess&) = delete;

  // False if it has closed its end, and if it has sent something that nobody asked for.
  bool IsIdle() const;

  // kEnded: it has closed its end; kLate: nothing more until the time of ClockSeconds().
  enum class Outcome { kDone, kEnded, kLate };
  Outcome Send(const void* data, size_t size, double until);
  Outcome Receive(void* data, size_t size, double until);  // all of it

  // Kills it if it still runs, and says how it ended: "Segmentation fault", "exit status 1".
  std::string End();

 private:
  int pid_ = -1;
  int socket_ = -1;
};

// The program's side of the socket. False at its end.
bool ReceiveFromStarter(void* data, size_t size);
bool SendToStarter(const void* data, size_t size);
// False if nothing comes for so long.
bool AwaitStarter(int milliseconds);
// Starts a thread that ends the program, whatever it does, once the starter has closed its end.
void EndWithStarter();

}  // namespace regrade
