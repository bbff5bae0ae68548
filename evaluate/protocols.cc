#include "evaluate/protocols.h"

#include <algorithm>
#include <optional>
#include <sstream>
#include <utility>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr char kProtocol[] = "--protocol";

// The flag's value at words[i], in either form, or nothing if that word is another one.
std::optional<std::string> ValueAt(const std::vector<std::string>& words, size_t i,
                                   const std::string& flag) {
  if (words[i].starts_with(flag + "=")) return words[i].substr(flag.size() + 1);
  if (words[i] == flag) return i + 1 < words.size() ? words[i + 1] : "";
  return std::nullopt;
}

const Protocol& Named(const std::string& name) {
  const auto found = std::ranges::find(Protocols(), name, &Protocol::name);
  if (found == Protocols().end())
    throw UsageError("there is no protocol '" + name + "'", kProtocol,
                     std::string("use one of ") + ProtocolChoices());
  return *found;
}

std::vector<int> GapsOf(const Protocol& protocol) {
  std::vector<int> gaps;
  std::istringstream text(protocol.gaps);
  for (std::string gap; std::getline(text, gap, ',');) gaps.push_back(std::stoi(gap));
  return gaps;
}

[[noreturn]] void Refuse(const Protocol& protocol, const std::string& flag,
                         const std::string& why) {
  throw UsageError("--protocol " + protocol.name + " " + why, flag,
                   "leave out " + flag +
                       ", or give --mode, --gaps, --warp, --error-per and --flow without " +
                       kProtocol);
}

// The flags that a protocol may leave to the user, with its values.
std::vector<std::pair<std::string, std::string>> SwitchesOf(const Protocol& protocol) {
  return {{"--mode", protocol.mode},
          {"--gaps", protocol.gaps},
          {"--warp", protocol.warp},
          {"--error-per", protocol.error_per}};
}

}  // namespace

const std::vector<Protocol>& Protocols() {
  static const std::vector<Protocol> protocols{
      {"liprf", "ruder2016", "1,5", "earlier", "", true,
       "LipRF: short and long range, the mask of Ruder et al., the earlier frame warped"},
      {"lai2018", "lai2018", "1", "later", "channel", true,
       "Lai et al. 2018, as their evaluator computes it"},
      {"ruder2016", "ruder2016", "1", "", "channel", true,
       "Ruder et al. 2016, as their checker computes it"},
      {"stylegaussian", "stylegaussian", "1,7", "", "", true,
       "StyleGaussian: RMSE and LPIPS after forward warping, as published and corrected"},
      {"geometry", "geometry", "1,5", "", "channel", false,
       "exact motion from depth and cameras"},
  };
  return protocols;
}

const char* ProtocolChoices() {
  static const std::string choices = [] {
    std::string text;
    for (const Protocol& protocol : Protocols())
      text += (text.empty() ? "" : "|") + protocol.name;
    return text;
  }();
  return choices.c_str();
}

void UseProtocol(const std::string& name, ConsistencyOptions* options) {
  const Protocol& protocol = Named(name);
  options->mode = protocol.mode;
  options->gaps = GapsOf(protocol);
  if (!protocol.warp.empty()) options->warp = protocol.warp;
  if (!protocol.error_per.empty()) options->error_per = protocol.error_per;
}

std::string ProtocolOf(const ConsistencyOptions& options) {
  const auto agrees = [](const std::string& value, const std::string& own) {
    return own.empty() || value == own;
  };
  for (const Protocol& protocol : Protocols())
    if (options.mode == protocol.mode && options.gaps == GapsOf(protocol) &&
        agrees(options.warp, protocol.warp) && agrees(options.error_per, protocol.error_per))
      return protocol.name;
  return "";
}

std::vector<std::string> ExpandProtocol(const std::vector<std::string>& words) {
  const size_t end = std::ranges::find(words, "--") - words.begin();
  const Protocol* protocol = nullptr;
  std::vector<std::string> kept;
  for (size_t i = 0; i < words.size(); ++i) {
    const auto name = i < end ? ValueAt(words, i, kProtocol) : std::nullopt;
    if (!name) {
      kept.push_back(words[i]);
      continue;
    }
    if (protocol) throw UsageError("the option is given twice", kProtocol, "give it once");
    protocol = &Named(*name);
    if (words[i] == kProtocol) ++i;
  }
  if (!protocol) return words;

  std::vector<std::string> flags;
  for (const auto& [flag, value] : SwitchesOf(*protocol))
    if (!value.empty()) flags.push_back(flag + "=" + value);
  for (size_t i = 0; i < end; ++i) {
    if (!protocol->has_flow && ValueAt(words, i, "--flow"))
      Refuse(*protocol, "--flow", "takes motion from depth and cameras, not from flow");
    for (const auto& [flag, value] : SwitchesOf(*protocol)) {
      const auto given = ValueAt(words, i, flag);
      if (!given || value.empty()) continue;
      if (*given != value)
        Refuse(*protocol, flag, "has " + flag + " " + value + ", not " + *given);
      std::erase(flags, flag + "=" + value);
    }
  }
  kept.insert(kept.begin(), flags.begin(), flags.end());
  return kept;
}

}  // namespace regrade
