// network.npz: the Lipschitz network of a style, with the bound guaranteed for it.
//
// For layers l = 0..5: weight_l f32[out, in], bias_l f32[out], k_l f32 (before squareplus), u_l
// f32[out] and v_l f32[in] (the running singular vectors). For the whole: activation u8[]
// (its name), omega, sh_scale, position_scale f32, has_base u8, base_matrix f64[3,3],
// base_offset f64[3], bound f64 (EQ(liprf-bound)), k_est f64, background f32[3] (of the styled
// field), regrade_version i32.
#pragma once

#include <string>

#include "kernels/base/vec.h"
#include "stylize/field/lipschitz_network.h"

namespace regrade {

struct StoredNetwork {
  LipschitzNetwork network;
  double k_est = 0;  // ||M||_2 of the scene's colour map, the target of the bound
  Vec3f background;  // colour of the styled field behind everything
};

// Floats keep all their bits; equal networks give equal bytes. Throws Error(kResources).
void WriteNetworkFile(const std::string& path, const StoredNetwork& stored);

// Throws Error(kInput) for files that are damaged, of another format, not a network, or whose
// bound is not that of their weights.
StoredNetwork ReadNetworkFile(const std::string& path);

}  // namespace regrade
