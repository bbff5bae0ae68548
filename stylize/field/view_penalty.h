// View-dependence penalty of the residual.
//
// EQ(view-penalty):  L_view = lambda_view / (3 Q) sum_v,c m_v,c / (4 pi) sum_{k >= 1} g_vck^2.
//
// g_v = f(x_v) - (A (x) I_9) s_v - o is what the network adds to the colour map at point v,
// channel-major coefficients of orthonormal spherical harmonics, so the inner sum over 4 pi is
// the mean over all directions of the squared deviation of that addition from its own mean.
// m_v,c is the weight with which the rays of a step see the point: the sum over samples of w_i
// and the corner's trilinear weight, where the loss has a gradient (the ray has an error and
// channel c is not clamped at 0). It is held constant. Background texels have no directions,
// and no mass.
//
// A 2D method maps each view its own way; what a point can follow of that is a function of the
// direction, and a film shows it as flicker.
#pragma once

#include "kernels/base/host_device.h"

namespace regrade {

// Of one coefficient k >= 1, without lambda_view / (3 Q).
template <typename T>
struct ViewPenalty {
  T value, derivative;
};

template <typename T>
HD ViewPenalty<T> ViewPenaltyOf(T mass, T change) {
  constexpr T kPerDirection = T(0.07957747154594767);  // 1 / (4 pi)
  const T pull = kPerDirection * mass * change;
  return {pull * change, 2 * pull};
}

}  // namespace regrade
