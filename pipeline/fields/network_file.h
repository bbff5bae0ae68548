// network.npz: the Lipschitz network that made styled.npz, with the bound guaranteed for it.
//
// For layers l = 0..5: weight_l f32[out, in], bias_l f32[out], k_l f32 (before squareplus), u_l
// f32[out] and v_l f32[in] (the running singular vectors). For the whole: activation u8[]
// (its name), omega, sh_scale, position_scale f32, has_base u8, base_matrix f64[3,3],
// base_offset f64[3], bound f64 (EQ(liprf-bound)), k_est f64, regrade_version i32.
#pragma once

#include <string>

#include "stylize/field/lipschitz_network.h"

namespace regrade {

struct StoredNetwork {
  LipschitzNetwork network;
  double k_est = 0;  // ||M||_2 of the scene's colour map, what the bound was drawn towards
};

// Floats keep all their bits; equal networks give equal bytes. Throws Error(kResources).
void WriteNetworkFile(const std::string& path, const StoredNetwork& stored);

// Throws Error(kInput) for files that are damaged, from a newer version of this program, not a
// network, or whose bound is not the one that their weights have.
StoredNetwork ReadNetworkFile(const std::string& path);

}  // namespace regrade
