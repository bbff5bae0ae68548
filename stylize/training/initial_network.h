// Where learning the network starts: as PyTorch would, as others would without a map, or at the
// colour map with a residual that already explains part of what the map cannot.
#pragma once

#include <cstdint>
#include <string>

#include "stylize/field/gradient_aggregation.h"
#include "stylize/field/lipschitz_network.h"

namespace regrade {

// PyTorch's nn.Linear: weights and biases uniform in +-1 / sqrt(inputs); K_i = ||W_i||_2, so
// that A_i = W_i at the start.
void InitializeAsPyTorch(uint64_t seed, LipschitzNetwork* network);

// Without a colour map, "pytorch" as above, or to see what that costs: "orthogonal", layers
// that are random isometries with small biases, or "identity", which halves the coefficients
// and position, hands them through the first units and doubles the coefficients at the end: but
// for the activations the colours that are there. The other units are PyTorch's. Or "siren"
// (Sitzmann et al. 2020, section 3.2, with omega = 30 folded into weights and biases): weights
// uniform in +-30 / n in the first layer of n inputs, +-sqrt(6 / n) in the hidden ones and
// +-sqrt(6 / n) / 30 in the last, biases in +-30 / sqrt(n), in the last +-1 / sqrt(n);
// "siren-wide-end": +-sqrt(6 / n) in the last layer; "siren-even": in the first one, too.
void InitializeWithoutMap(const std::string& start, uint64_t seed, LipschitzNetwork* network);

// Hidden layers are isometries (random matrices made orthogonal), so that a bound is spent
// evenly; the first layer's biases spread the units over the sine's whole period. The last
// layer is zero: the network is its colour map, exactly.
void InitializeResidual(uint64_t seed, LipschitzNetwork* network);

// Makes the residual exactly zero.
void ClearLastLayer(LipschitzNetwork* network);

// Sets the last layer's constant coefficients (degree 0) by a ridge regression: what the colour
// map leaves missing, explained by the sums of hidden activations along rays. Of ridges growing
// from nearly none, the first whose LearnedBound() is within `budget`.
//
// EQ(output-layer): min over W [3, 64], b [3] of
//   sum_r |missing_r - Gamma_0 (W h_r + b O_r)|^2 + ridge n |W|^2,  O_r = 1 - T_r.
void SolveOutputLayer(const StyleLoss::HiddenSums& sums, double budget,
                      LipschitzNetwork* network);

}  // namespace regrade
