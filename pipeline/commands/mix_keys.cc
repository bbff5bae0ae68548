#include "pipeline/commands/mix_keys.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "kernels/base/error.h"
#include "pipeline/files/text.h"

namespace regrade {
namespace {

std::vector<double> ParsePoint(const std::string& text, int styles) {
  const auto refuse = [&](const std::string& why) {
    throw UsageError("\"" + text + "\" " + why, "--mix",
                     styles == 1
                         ? "write weights of the style separated by colons, such as 0:1"
                         : Concat("write a weight for each of the ", styles,
                                  " styles separated by commas, and points separated by "
                                  "colons, such as 1,0:0,1 for two"));
  };
  std::vector<double> weights;
  double sum = 0;
  for (const std::string& word : Split(text, ',')) {
    double weight = 0;
    const char* const end = word.data() + word.size();
    const auto [rest, bad] = std::from_chars(word.data(), end, weight);
    if (bad != std::errc() || rest != end || !std::isfinite(weight)) refuse("is not a number");
    if (weight < 0 || weight > 1) refuse("is not between 0 and 1");
    weights.push_back(weight);
    sum += weight;
  }
  if (static_cast<int>(weights.size()) != styles)
    refuse(Concat("has ", Counted(std::ssize(weights), "weight"), " for ",
                  Counted(styles, "style")));
  if (sum > 1 + 1e-9) refuse("adds up to more than 1");
  return weights;
}

}  // namespace

std::vector<double> MixKeys::At(double time) const {
  const double position = time * static_cast<double>(points.size() - 1);
  const size_t before = std::min(static_cast<size_t>(position), points.size() - 1);
  const double fraction = position - static_cast<double>(before);
  if (fraction == 0 || before + 1 == points.size()) return points[before];
  std::vector<double> weights = points[before];
  for (size_t i = 0; i < weights.size(); ++i)
    weights[i] = (1 - fraction) * points[before][i] + fraction * points[before + 1][i];
  return weights;
}

bool MixKeys::IsConstant() const {
  return std::ranges::all_of(points, [this](const auto& point) { return point == points[0]; });
}

MixKeys ParseMixKeys(const std::string& text, int styles) {
  MixKeys keys;
  if (text.empty()) {
    keys.points.emplace_back(static_cast<size_t>(styles), 0.0);
    for (int i = 0; i < styles; ++i) {
      keys.points.emplace_back(static_cast<size_t>(styles), 0.0);
      keys.points.back()[i] = 1;
    }
    return keys;
  }
  for (const std::string& point : Split(text, ':'))
    keys.points.push_back(ParsePoint(point, styles));
  return keys;
}

}  // namespace regrade
