// The published protocols of temporal consistency by name, and the flags each stands for.
#pragma once

#include <string>
#include <vector>

#include "evaluate/consistency.h"

namespace regrade {

// One protocol. An empty text leaves the flag to the user.
struct Protocol {
  std::string name;
  std::string mode;       // --mode
  std::string gaps;       // --gaps
  std::string warp;       // --warp
  std::string error_per;  // --error-per
  // A protocol with exact motion has none to estimate, so --flow contradicts it.
  bool has_flow = true;
  std::string source;  // the definition that it follows
};

// All protocols; the only place that defines them. evaluate/PROTOCOLS.md describes each.
const std::vector<Protocol>& Protocols();

// "liprf|lai2018|...": the choices of --protocol.
const char* ProtocolChoices();

// Sets what the protocol decides. Throws Error(kUsage) for an unknown name.
void UseProtocol(const std::string& name, ConsistencyOptions* options);

// The name of the protocol whose values the options have; empty if they follow none.
std::string ProtocolOf(const ConsistencyOptions& options);

// Replaces "--protocol NAME" among the words of a command line by the flags that it stands for.
// Words without it come back as they are. A flag with the protocol's own value is allowed.
//
// Errors: kUsage for an unknown or missing name, for a protocol given twice, and for a flag
// that contradicts the protocol.
std::vector<std::string> ExpandProtocol(const std::vector<std::string>& words);

}  // namespace regrade
