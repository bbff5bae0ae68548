// The cheapest way to move one small discrete distribution onto another.
#pragma once

#include <vector>

namespace regrade {

// EQ(transport-plan): min over w >= 0 of sum_kl w_kl c_kl with the row sums `from` and the
// column sums `to`, which are positive and have the same sum. Weights are rounded to 2^-40 of
// that sum and moved in whole units along cheapest paths (successive shortest paths): the plan
// is a vertex of the polytope, the same on every machine, and exact for the rounded weights.
// `cost` [from, to], finite. For tens of parts: the time grows with the fourth power.
std::vector<std::vector<double>> TransportPlan(const std::vector<double>& from,
                                               const std::vector<double>& to,
                                               const std::vector<std::vector<double>>& cost);

}  // namespace regrade
