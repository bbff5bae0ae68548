// The narrow network on a CUDA device: 16 rows a warp on the tensor cores, from the first layer
// to the last without leaving the registers, and back. Held to dense_layer.h by the parity
// table. Shapes and padding as in fused_mlp.h.
#pragma once

#include <cstdint>

#include "kernels/device/device_memory.h"
#include "kernels/network/fused_mlp.h"

namespace regrade {

// How products are rounded. A factor of kTensor has 10 bits of mantissa (TF32), a relative
// error of 5e-4 at most; kSplit gives each factor as the sum of two such numbers, three
// products for one, and is as good as float. Sums are of floats in both. Devices before compute
// capability 8.0 have no TF32 and always sum products of floats.
enum class MlpPrecision { kTensor, kSplit };

class DeviceMlp {
 public:
  explicit DeviceMlp(const FusedMlp& mlp);
  // Other weights for the same shapes.
  void Set(const FusedMlp& mlp);

  // output [n, kMlpEndLanes] of input [n, kMlpEndLanes]; both on the device. `counted`, if it
  // is not null, lies there too: n is no more than room then, and *counted rows are meant.
  void Forward(MlpPrecision precision, const float* input, int64_t n, float* output,
               const int32_t* counted = nullptr) const;

  // Adds the adjoint for d_output [n, kMlpEndLanes] to sums that TakeGradient gives and sets to
  // zero. The forward pass is done again a chunk at a time, so memory does not grow with n.
  void AddAdjoint(MlpPrecision precision, const float* input, const float* d_output, int64_t n,
                  const int32_t* counted = nullptr);
  void ReserveAdjoint(int64_t n);                     // makes the room for it beforehand
  void TakeGradient(DenseNetwork<double>* gradient);  // adds to it; the unpadded shapes

  // For those that learn on the device, laid out as FusedMlp::Offset says: the weights that
  // act, and the sums so far.
  float* parameters() { return parameters_.data(); }
  const DeviceBuffer<double>& gradient() const { return gradient_; }
  int64_t ParameterOffset(size_t layer) const { return shape_.Offset(layer); }

 private:
  FusedMlp shape_;                  // its weights are of no interest
  DeviceBuffer<float> parameters_;  // as FusedMlp::Offset says
  DeviceBuffer<double> gradient_;   // the same
  DeviceBuffer<float> scratch_;     // see device_mlp.cu
};

}  // namespace regrade
