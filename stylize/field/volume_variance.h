// Differences of two rays' colours before and after restyling, against LipRF's bound, grouped
// by the premise of the bound that is violated.
//
// EQ(vrr), LipRF eq. 5: vrr(r1, r2; F) = |C(r1; F) - C(r2; F)|.
//
// EQ(vrr-bound): for the field restyled by f = A + g, see EQ(liprf-network), where no colour is
// clamped and the weights of either ray sum to 1,
//   vrr' <= |A| vrr + |Gamma| K_g W1(mu_1, mu_2) + |sum_j mu_2j g_j| |Gamma(d_1) - Gamma(d_2)|.
// mu_r are the weights that ray r gives to voxels: the linear part of a ray's colour is A C + o
// Gamma_0 (Lemma 2), and o cancels. What g adds is (E_1 g - E_2 g) Gamma_1 + E_2 g (Gamma_1 -
// Gamma_2); for any coupling pi of mu_1 and mu_2 the first is sum pi_jk (g_j - g_k) Gamma_1, at
// most |Gamma| K_g sum pi_jk |x_j - x_k|. Here pi joins the rays' voxels in the order in which
// light meets them, so the sum is W1's upper bound. |Gamma|^2 = B / (4 pi) for every direction.
// Splats have directions d_rj of their own, see EQ(splat-color): in place of the last term is
//   sum pi_jk |g_k| |Gamma(d_1j) - Gamma(d_2k)|,
// to which a splat that both rays of one camera see adds nothing. Where a ray transmits light,
// the background is one more member of mu, behind all others, with the transmittance for weight
// and e = c_bg' - A c_bg - b in place of g Gamma, (A, b) the map of colours: coupled with j it
// adds pi |g_j Gamma(d_j) - e|.
//
// The propositions say K vrr, K = |A| + K_g: that holds for A alone (Prop. 1 and 3), and for g
// under Prop. 2's premise that the rays' weighted colours agree sample by sample, which
// neighbouring rays need not do.
//
// Where an object alone is styled, a voxel of weight e has the coefficients x + e (f(x) - x):
// with e = 1 for all that two rays see, the bound is the network's.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/field/ray_march.h"
#include "kernels/render/ray_weigher.h"
#include "stylize/field/lipschitz_network.h"
#include "stylize/field/ray_pairs.h"

namespace regrade {

struct VarianceGroup {
  int64_t pairs = 0;
  int64_t above = 0;          // vrr' > K vrr, and by more than kVarianceSlack
  double largest_excess = 0;  // of vrr' over K vrr; white is sqrt(3)
  double sum_styled = 0, sum_source = 0;

  double Gain() const { return sum_source > 0 ? sum_styled / sum_source : 0; }  // of the mean
};

// A pair is counted in the first group whose condition it meets.
struct VarianceReport {
  double k = 0;                 // |A| + K_g; at least 1 where an object alone is styled
  VarianceGroup partial;        // a ray sees a voxel whose object weight is below 1
  VarianceGroup spheres;        // a ray sees a background sphere
  VarianceGroup transparent;    // a ray transmits light, or passes cells with empty corners
  VarianceGroup clamped;        // a sample's colour is clamped, before or after
  VarianceGroup valid;          // every premise of the bound holds
  double largest_fraction = 0;  // see EQ(vrr-bound), over pairs without spheres,
                                // parts of objects, empty corners and clamps; at most 1

  int64_t Pairs() const {
    return partial.pairs + spheres.pairs + transparent.pairs + clamped.pairs + valid.pairs;
  }
};

inline constexpr double kVarianceSlack = 1e-5;             // float's rounding in a ray's colour
inline constexpr double kTransparentTransmittance = 1e-2;  // more than that is background

// `styled` is `source` restyled by `network`, where `object_weights` [voxels] are given by
// MixFields with them. Colours are as rendered, but not clipped to [0, 1]. Sums in double; the
// result does not depend on the number of threads. `weigher`: as of PixelsOfOnePoint.
VarianceReport MeasureVariance(const RadianceField& source, const RadianceField& styled,
                               const LipschitzNetwork& network, const RayPairs& pairs,
                               RayWeigher* weigher,
                               const std::vector<float>* object_weights = nullptr);

}  // namespace regrade
