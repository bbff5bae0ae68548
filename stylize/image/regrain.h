// Gives a picture whose colours were moved the edges and grain of the picture it was made of.
#pragma once

#include "kernels/scene/image.h"

namespace regrade {

// EQ(regrain), Pitie, Kokaram and Dahyot 2007, Sec. 5: the J that minimises
//   sum_p psi_p |J_p - T_p|^2 + sum_(p,q) phi_pq |(J_p - J_q) - (I_p - I_q)|^2
// over pixels p and pairs (p, q) of neighbours, I the picture and T what colour transfer made
// of it: J has T's colours where they are flat and I's differences everywhere, so what the
// transfer made louder (grain) or cut (edges it quantised) is I's again.
//   psi_p = min(1, 256 / 5 g_p): flat parts of I, where T's differences are noise, follow their
//   neighbours; phi_p = 30 / (1 + 10 g_p): steep parts of I may take the transfer's contrast;
//   g_p = |grad I_p| of the mean colour, phi_pq the mean of both ends'.
// As published but for one thing: psi is at least kLeastFaith, so that a picture without any
// gradient has an answer. The normal equations are solved from a small picture up to the whole
// one, each starting from the smaller one's answer, by conjugate gradients.
//
// `picture` and `transferred` [H, W, 3], finite. Values may leave [0, 1].
Image Regrain(const Image& picture, const Image& transferred);

inline constexpr float kLeastFaith = 1e-3f;

}  // namespace regrade
