// Networks that the program fetches: what they are, where they come from, where they are kept.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace regrade {

struct PublishedFile {
  std::string name, address;
  std::string sha256;  // of the bytes that are taken, and of no others
  uint64_t bytes = 0;
};

struct KnownNetwork {
  std::string name;     // as in --method
  std::string summary;  // who made it, and under which licence
  std::string licence;  // text, kept beside it
  std::vector<PublishedFile> files;
  // Contents of `files` to named contents of the files that the program reads.
  std::vector<std::pair<std::string, std::string>> (*convert)(
      const std::vector<std::string>& contents, const std::string& where);
};

const std::vector<KnownNetwork>& KnownNetworks();
// Throws Error(kUsage) that lists the names.
const KnownNetwork& FindNetwork(const std::string& name);

// $XDG_DATA_HOME/regrade/networks, or ~/.local/share/regrade/networks. Throws
// Error(kResources) where neither XDG_DATA_HOME nor HOME is an absolute path.
std::string NetworksFolder();
std::string NetworkFolder(const std::string& name);
bool HasNetwork(const KnownNetwork& network);

struct NetworkAccess {
  std::function<std::string(const std::string& address)> fetch;
  // Says what would be fetched and returns whether it may; empty where nobody can be asked.
  std::function<bool(const std::string& offer)> ask;
};

// Returns the folder of the network, whole: files that a person put there are checked and
// converted; what is missing is fetched after a yes. Each file has the published SHA-256 or is
// not used. The file that the method is recognised by is written last. Throws Error(kInput)
// with all addresses and the folder where it may not be fetched, cannot be, or differs.
std::string EnsureNetwork(const KnownNetwork& network, const NetworkAccess& access);

// Removes the network's folder; false if there is none.
bool RemoveNetwork(const KnownNetwork& network);

}  // namespace regrade
