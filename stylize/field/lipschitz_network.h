// The network that restyles a field's spherical harmonics, and the bound that is guaranteed for
// it.
//
// EQ(liprf-network):  f(s, q) = (A (x) I_B) s + o + g(s, q),
// s [3 B] the coefficients of a record, channel-major, q [3] its position in the box, scaled to
// [-position_scale, position_scale]; g is five activated layers of 64 and a linear one, each
// EQ(lipschitz-layer); A and o carry a colour map into coefficients (LipRF, Lemma 2). LipRF's
// own network has no colour map: A = 0, o = 0. B is 9, or 16 of splats of degree 3.
//
// EQ(liprf-bound):  ||f(x) - f(y)|| <= (||A||_2 + L_act^5 prod_l ||A_l||_2) ||x - y||  for x =
// (s, q), with ||A_1||_2 that of A_1 diag(sh_scale, 1). Norms are exact singular values, in
// double, of the stored weights. It bounds coefficients; of rendered colours see
// EQ(color-bound) and EQ(vrr-bound).
//
// EQ(color-bound): two appearances f and g of one geometry and background have rendered
// colours, not clipped to [0, 1], with
//   |C(f) - C(g)| <= |Gamma| sum_i w_i |f_i - g_i| <= (1 - T) |Gamma| max_i |f_i - g_i|,
// i the ray's samples: Cauchy and Schwarz in each channel, and the clamp at 0 moves no two
// colours apart. |Gamma| = (L + 1) / (2 sqrt(pi)) in every direction: 0.846 at degree L = 2,
// 1.128 at L = 3. So two scenes whose coefficients differ by d have styles whose pictures
// differ by |Gamma| times the bound times d at most, of voxels and of splats.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "kernels/base/buffer.h"
#include "kernels/field/radiance_field.h"
#include "kernels/network/dense_layer.h"
#include "stylize/field/network_row.h"
#include "stylize/linear_map.h"

namespace regrade {

inline constexpr int kNetworkLayers = 6;  // five activated and the last

Activation ActivationByName(const std::string& name);  // throws Error(kUsage)
const char* NameOf(Activation activation);

// Everything that is stored of a network: plain, so that any file format can carry it.
struct LipschitzNetworkData {
  int basis = 9;  // see NetworkRow
  std::string activation = "sine";
  float omega = 1;           // of the sine
  float sh_scale = 1;        // coefficients are multiplied by it on the way in
  float position_scale = 1;  // positions, [-1, 1] across the box, are multiplied by it
  bool has_base = false;     // a colour map is added to the network
  ColorMap base;
  std::vector<float> parameters;        // by layer: W [out, in], bias [out], K
  std::vector<float> singular_vectors;  // by layer: u [out], v [in]
};

class LipschitzNetwork {
 public:
  // Zero weights.
  explicit LipschitzNetwork(int basis = kMaxVoxelBasis);
  // Throws Error(kInput) for sizes or values that are not a network.
  explicit LipschitzNetwork(LipschitzNetworkData data);

  const LipschitzNetworkData& data() const { return data_; }
  LipschitzNetworkData& data() { return data_; }

  NetworkRow row() const { return {data_.basis}; }
  int Outputs(int layer) const;
  int Inputs(int layer) const;
  int64_t NumParameters() const;
  // Where a layer begins in LipschitzNetworkData's parameters and singular_vectors.
  int64_t WeightOffset(int layer) const;
  int64_t VectorOffset(int layer) const;
  float* weight(int layer);  // [Outputs, Inputs]
  float* bias(int layer);    // [Outputs]
  float& k(int layer);       // before squareplus
  const float* weight(int layer) const { return Mutable()->weight(layer); }
  const float* bias(int layer) const { return Mutable()->bias(layer); }
  float k(int layer) const { return Mutable()->k(layer); }

  // Power iteration: its start, from there until it has settled, and one step of it.
  void RestartNorms();
  void WarmUpNorms();
  void StepNorms();

  // The matrices A_l as they act, input scaling included. For float and double.
  template <typename T>
  DenseNetwork<T> Effective() const;
  // Adds to gradient [NumParameters()] what dL/dA_l, dL/db_l say; u and v are held constant.
  void AddGradient(const DenseNetwork<double>& d_effective,
                   std::vector<double>* gradient) const;

  // output [n, stride]: coefficients of features [n, stride] (see FillFeatures and NetworkRow).
  void Forward(const float* features, int64_t n, float* output) const;
  // The same for one row in double, plainly: the specification.
  void ForwardPlain(const double* features, double* output) const;

  // See EQ(liprf-bound): its two parts, and the largest sigma / sigma_hat - 1 of a layer.
  double BaseNorm() const;
  double LearnedBound() const;
  double Bound() const { return BaseNorm() + LearnedBound(); }
  double NormDrift() const;
  // sigma_hat of a layer's W, from the running singular vectors.
  double NormEstimate(int layer) const;
  // The smallest squareplus(K_l).
  double SmallestK() const;

 private:
  LipschitzNetwork* Mutable() const { return const_cast<LipschitzNetwork*>(this); }

  LipschitzNetworkData data_;
};

// Adds (A (x) I_B) s + o to output [3, basis] for coefficients s [3, basis].
template <typename T>
void AddBaseMap(const ColorMap& map, int basis, const T* sh, T* output) {
  T mapped[kLargestRow.sh()];
  MapCoefficients(map, basis, sh, mapped);
  for (int i = 0; i < 3 * basis; ++i) output[i] += mapped[i];
}

// The vertex of each voxel: the inverse of Geometry::links. Of splats, the splat.
std::vector<int32_t> VertexOfVoxel(const Geometry& geometry);

// Feature row of a voxel, as RowOf(field.appearance.basis) says; `vertex` as VertexOfVoxel has
// it. Coefficients of a smaller basis are padded with zeros, which leaves the bound as it is.
// Positions of splats: EQ(splat-position).
void FillFeatures(const RadianceField& field, float position_scale, int64_t voxel,
                  int32_t vertex, float* row);

// The same of a texel of a background sphere: its colour as degree 0, its direction on the unit
// sphere as the position. `at`: its place in the map, x R + y.
void FillTexelFeatures(const RadianceField& field, float position_scale, int64_t texel,
                       int32_t at, float* row);

// The place in the map of each column: the inverse of SphereGeometry::links.
std::vector<int32_t> PlaceOfColumn(const SphereGeometry& spheres);

}  // namespace regrade
