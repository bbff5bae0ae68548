#include "kernels/base/error.h"
#include "kernels/device/device_graph.h"
#include "kernels/device/device_memory.h"
#include "kernels/device/device_stream.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

thread_local cudaStream_t capturing = nullptr;

void Require(cudaError_t status, const char* what) {
  if (status == cudaSuccess) return;
  throw Error(ExitCode::kResources, std::string(what) + ": " + cudaGetErrorString(status),
              "GPU", "use --device cpu");
}

// A capturing stream. Its destructor ends the capture in every case, so that later launches
// run.
class CaptureScope {
 public:
  CaptureScope() {
    Require(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking),
            "creating a stream for capture");
    const cudaError_t status =
        cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal);
    if (status != cudaSuccess) cudaStreamDestroy(stream_);
    Require(status, "capturing");
    capturing = stream_;
  }
  cudaGraph_t End() {
    cudaGraph_t graph = nullptr;
    capturing = nullptr;
    ended_ = true;
    Require(cudaStreamEndCapture(stream_, &graph), "capturing a step");
    return graph;
  }
  ~CaptureScope() {
    capturing = nullptr;
    if (!ended_) {
      cudaGraph_t graph = nullptr;
      cudaStreamEndCapture(stream_, &graph);
      if (graph != nullptr) cudaGraphDestroy(graph);
    }
    cudaStreamDestroy(stream_);
  }

 private:
  cudaStream_t stream_ = nullptr;
  bool ended_ = false;
};

}  // namespace

cudaStream_t LaunchStream() { return capturing; }

void DeviceGraph::Capture(const std::function<void()>& body) {
  Forget();
  CaptureScope scope;
  body();
  cudaGraph_t graph = scope.End();
  cudaGraphExec_t executable = nullptr;
  const cudaError_t status = cudaGraphInstantiate(&executable, graph, 0);
  cudaGraphDestroy(graph);
  Require(status, "capturing a step");
  executable_ = executable;
}

void DeviceGraph::Launch() const {
  Require(cudaGraphLaunch(static_cast<cudaGraphExec_t>(executable_), nullptr),
          "launching a captured step");
}

void DeviceGraph::Forget() noexcept {
  if (executable_ != nullptr) cudaGraphExecDestroy(static_cast<cudaGraphExec_t>(executable_));
  executable_ = nullptr;
}

#else

void DeviceGraph::Capture(const std::function<void()>&) { DeviceWait("capturing"); }
void DeviceGraph::Launch() const { DeviceWait("launching a captured step"); }
void DeviceGraph::Forget() noexcept {}

#endif

DeviceGraph::~DeviceGraph() { Forget(); }

}  // namespace regrade
