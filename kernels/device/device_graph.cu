#include "kernels/base/error.h"
#include "kernels/device/device_graph.h"
#include "kernels/device/device_memory.h"
#include "kernels/device/device_stream.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

thread_local cudaStream_t recording = nullptr;

void Require(cudaError_t status, const char* what) {
  if (status == cudaSuccess) return;
  throw Error(ExitCode::kResources, std::string(what) + ": " + cudaGetErrorString(status),
              "GPU", "use --device cpu");
}

// A stream that records; whatever happens, what is launched afterwards runs again.
class Recorder {
 public:
  Recorder() {
    Require(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking), "a stream to record");
    const cudaError_t status =
        cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal);
    if (status != cudaSuccess) cudaStreamDestroy(stream_);
    Require(status, "recording");
    recording = stream_;
  }
  cudaGraph_t Take() {
    cudaGraph_t graph = nullptr;
    recording = nullptr;
    taken_ = true;
    Require(cudaStreamEndCapture(stream_, &graph), "what was recorded");
    return graph;
  }
  ~Recorder() {
    recording = nullptr;
    if (!taken_) {
      cudaGraph_t graph = nullptr;
      cudaStreamEndCapture(stream_, &graph);
      if (graph != nullptr) cudaGraphDestroy(graph);
    }
    cudaStreamDestroy(stream_);
  }

 private:
  cudaStream_t stream_ = nullptr;
  bool taken_ = false;
};

}  // namespace

cudaStream_t LaunchStream() { return recording; }

void DeviceGraph::Record(const std::function<void()>& body) {
  Forget();
  Recorder recorder;
  body();
  cudaGraph_t graph = recorder.Take();
  cudaGraphExec_t playable = nullptr;
  const cudaError_t status = cudaGraphInstantiate(&playable, graph, 0);
  cudaGraphDestroy(graph);
  Require(status, "what was recorded");
  playable_ = playable;
}

void DeviceGraph::Play() const {
  Require(cudaGraphLaunch(static_cast<cudaGraphExec_t>(playable_), nullptr), "a recorded step");
}

void DeviceGraph::Forget() noexcept {
  if (playable_ != nullptr) cudaGraphExecDestroy(static_cast<cudaGraphExec_t>(playable_));
  playable_ = nullptr;
}

#else

void DeviceGraph::Record(const std::function<void()>&) { DeviceWait("recording"); }
void DeviceGraph::Play() const { DeviceWait("a recorded step"); }
void DeviceGraph::Forget() noexcept {}

#endif

DeviceGraph::~DeviceGraph() { Forget(); }

}  // namespace regrade
