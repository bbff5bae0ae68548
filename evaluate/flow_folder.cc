#include "evaluate/flow_folder.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <optional>

#include "evaluate/flow_file.h"
#include "kernels/base/error.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMostDigits = 18;  // of an int64_t

// The last run of digits before `end`, which then lies before it.
std::optional<int64_t> LastNumber(const std::string& text, size_t* end) {
  const auto digit = [&](size_t i) {
    return std::isdigit(static_cast<unsigned char>(text[i])) != 0;
  };
  size_t begin = *end;
  while (begin > 0 && digit(begin - 1)) --begin;
  if (begin == *end || *end - begin > kMostDigits) return std::nullopt;
  const int64_t number = std::stoll(text.substr(begin, *end - begin));
  *end = begin;
  return number;
}

// The frames of "take_00003_00004.flo"; nothing for other names.
std::optional<std::pair<int64_t, int64_t>> PairOf(const fs::path& path) {
  if (path.extension() != ".flo") return std::nullopt;
  const std::string stem = path.stem().string();
  size_t end = stem.size();
  const auto to = LastNumber(stem, &end);
  if (!to || end == 0) return std::nullopt;
  --end;  // whatever separates the two
  const auto from = LastNumber(stem, &end);
  if (!from) return std::nullopt;
  return std::pair{*from, *to};
}

}  // namespace

FlowFolder::FlowFolder(const std::string& folder, const std::vector<int64_t>& frames)
    : folder_(folder), frames_(frames) {
  std::vector<std::string> names;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(folder, none))
    names.push_back(entry.path().filename().string());
  std::ranges::sort(names);
  const auto exact = [](const std::string& name, const std::pair<int64_t, int64_t>& pair) {
    return name == Format("%05lld_%05lld.flo", static_cast<long long>(pair.first),
                          static_cast<long long>(pair.second));
  };
  for (const std::string& name : names) {
    const auto pair = PairOf(name);
    if (!pair) continue;
    const auto [known, added] = files_.emplace(*pair, name);
    if (added || exact(known->second, *pair)) continue;
    if (!exact(name, *pair))
      throw InputError(known->second + " and " + name + " are of the same pair of frames",
                       folder, "keep one of them");
    known->second = name;
  }
}

int64_t FlowFolder::Called(int frame) const {
  return frames_.empty() ? frame : frames_.at(static_cast<size_t>(frame));
}

bool FlowFolder::Has(int i, int j) const { return files_.contains({Called(i), Called(j)}); }

FlowField FlowFolder::Read(int i, int j, int width, int height) const {
  const int64_t from = Called(i), to = Called(j);
  const auto found = files_.find({from, to});
  if (found == files_.end())
    throw InputError(Concat("there is no flow file from frame ", from, " to frame ", to),
                     folder_ + Format("/%05lld_%05lld.flo", static_cast<long long>(from),
                                      static_cast<long long>(to)),
                     "every pair of --gaps needs its flow in both directions");
  const std::string path = folder_ + "/" + found->second;
  FlowField flow = ReadFlowFile(path);
  if (flow.width != width || flow.height != height)
    throw InputError(Concat("the flow is ", flow.width, " x ", flow.height, " px, the frames ",
                            width, " x ", height, " px"),
                     path, "compute it at the frames' size");
  return flow;
}

int64_t FlowFolder::LeastFrame() const {
  int64_t least = -1;
  for (const auto& [pair, name] : files_)
    for (const int64_t frame : {pair.first, pair.second})
      if (least < 0 || frame < least) least = frame;
  return least;
}

}  // namespace regrade
