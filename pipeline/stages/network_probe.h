// Opens networks from untrusted ONNX files, each in a child process first (see crash_probe.h).
#pragma once

#include <string>
#include <vector>

#include "evaluate/consistency.h"

namespace regrade {

// A network, or folder of networks, of `--method onnx:PATH`. Throws Error(kExternalProgram)
// naming the file.
void ProbeStyleNetwork(const std::string& path);
// The network of --match regions:FILE, likewise.
void ProbeFeatureNetwork(const std::string& path);

// The network of --depth-network, likewise.
void ProbeDepthNetwork(const std::string& path);

// The networks of `options`: each compares two small pictures in the child. Throws
// Error(kExternalProgram) naming the file.
void ProbeEvaluationNetworks(const ConsistencyOptions& options);

// The child: MEMORY KIND FILE, the arguments after kProbeFlag.
void RunNetworkProbe(const std::vector<std::string>& arguments);

}  // namespace regrade
