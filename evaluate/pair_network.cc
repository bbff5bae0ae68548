#include "evaluate/pair_network.h"

#include <memory>

#include "kernels/base/error.h"

namespace regrade {

PairNetwork::PairNetwork(const std::string& path)
    : runner_(
          path,
          "it must have two inputs named first and second, [1, 3, height, width] from -1 to "
          "1, and take pictures of any size") {}

FlowField PairNetwork::Flow(const Image& from, const Image& to) const {
  const OnnxArray output = runner_.Run({{"first", &from}, {"second", &to}});
  if (output.shape != std::vector<int>{1, 2, from.height, from.width})
    runner_.Refuse(Concat("its output is not a motion field of ", from.width, " x ",
                          from.height, " pixels"),
                   "expected: [1, 2, height, width]");
  FlowField flow(from.width, from.height);
  const size_t pixels = flow.uv.size() / 2;
  for (size_t p = 0; p < pixels; ++p)
    for (size_t c = 0; c < 2; ++c) flow.uv[2 * p + c] = output.values[c * pixels + p];
  return flow;
}

double PairNetwork::Distance(const Image& a, const Image& b, bool as_given) const {
  const OnnxArray output = runner_.Run({{"first", &a}, {"second", &b}}, as_given);
  double sum = 0;
  for (const float value : output.values) sum += value;
  return sum / static_cast<double>(output.values.size());
}

std::function<double(const Image&, const Image&)> PerceptualDistance(const std::string& path,
                                                                     bool as_given) {
  if (path.empty()) return {};
  const auto network = std::make_shared<const PairNetwork>(path);
  return [network, as_given](const Image& a, const Image& b) {
    return network->Distance(a, b, as_given);
  };
}

}  // namespace regrade
