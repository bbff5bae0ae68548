#include "stylize/image/transport_plan.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr int64_t kUnits = int64_t{1} << 40;

// Shares of kUnits; the largest takes what rounding leaves.
std::vector<int64_t> Units(const std::vector<double>& weights) {
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  REGRADE_CHECK(sum > 0 && std::isfinite(sum));
  std::vector<int64_t> units;
  int64_t left = kUnits;
  for (const double weight : weights) {
    REGRADE_CHECK(weight >= 0);
    units.push_back(std::llround(weight / sum * static_cast<double>(kUnits)));
    left -= units.back();
  }
  *std::ranges::max_element(units) += left;
  return units;
}

struct Network {
  std::vector<int64_t> supply, demand;     // what is left of them
  std::vector<std::vector<int64_t>> flow;  // [supply, demand]
  const std::vector<std::vector<double>>& cost;

  // One augmentation along a cheapest path; false where all is moved.
  bool Augment() {
    const size_t n = supply.size(), m = demand.size();
    constexpr double kFar = std::numeric_limits<double>::infinity();
    // Bellman and Ford: nodes are sources, then sinks; a path goes back along flow.
    std::vector<double> length(n + m, kFar);
    std::vector<size_t> before(n + m, n + m);
    for (size_t k = 0; k < n; ++k)
      if (supply[k] > 0) length[k] = 0;
    constexpr double kRounding = 1e-13;  // a saving below it is none, or rounding makes circles
    bool changed = true;
    for (size_t round = 0; round < n + m && changed; ++round) {
      changed = false;
      for (size_t k = 0; k < n; ++k) {
        for (size_t l = 0; l < m; ++l) {
          if (length[k] + cost[k][l] < length[n + l] - kRounding) {
            length[n + l] = length[k] + cost[k][l];
            before[n + l] = k;
            changed = true;
          }
          if (flow[k][l] > 0 && length[n + l] - cost[k][l] < length[k] - kRounding) {
            length[k] = length[n + l] - cost[k][l];
            before[k] = n + l;
            changed = true;
          }
        }
      }
    }
    size_t end = n + m;
    for (size_t l = 0; l < m; ++l)
      if (demand[l] > 0 && (end == n + m || length[n + l] < length[end])) end = n + l;
    if (end == n + m) return false;
    int64_t amount = demand[end - n];
    size_t node = end;
    for (size_t step = 0; before[node] != n + m; node = before[node], ++step) {
      REGRADE_CHECK(step <= n + m);
      if (node < n) amount = std::min(amount, flow[node][before[node] - n]);
    }
    amount = std::min(amount, supply[node]);
    supply[node] -= amount;
    demand[end - n] -= amount;
    for (node = end; before[node] != n + m; node = before[node]) {
      if (node < n)
        flow[node][before[node] - n] -= amount;
      else
        flow[before[node]][node - n] += amount;
    }
    return true;
  }
};

}  // namespace

std::vector<std::vector<double>> TransportPlan(const std::vector<double>& from,
                                               const std::vector<double>& to,
                                               const std::vector<std::vector<double>>& cost) {
  REGRADE_CHECK(!from.empty() && !to.empty() && cost.size() == from.size());
  Network network{Units(from), Units(to), {}, cost};
  network.flow.assign(from.size(), std::vector<int64_t>(to.size()));
  while (network.Augment()) {
  }
  const double sum = std::accumulate(from.begin(), from.end(), 0.0);
  std::vector<std::vector<double>> plan(from.size(), std::vector<double>(to.size()));
  for (size_t k = 0; k < from.size(); ++k)
    for (size_t l = 0; l < to.size(); ++l)
      plan[k][l] = static_cast<double>(network.flow[k][l]) / static_cast<double>(kUnits) * sum;
  return plan;
}

}  // namespace regrade
