// The narrow network on a CUDA device: 16 rows per warp on the tensor cores, all layers forward
// and back in registers. Parity tests compare it with dense_layer.h. Shapes and padding as in
// fused_mlp.h.
#pragma once

#include <cstdint>

#include "kernels/device/device_memory.h"
#include "kernels/network/fused_mlp.h"

namespace regrade {

// Rounding of products. A factor of kTensor has 10 bits of mantissa (TF32), a relative error of
// at most 5e-4; kSplit represents each factor as the sum of two TF32 numbers, uses three
// products for one, and is as accurate as float. Both sum in float. Devices before compute
// capability 8.0 have no TF32 and always multiply in float.
enum class MlpPrecision { kTensor, kSplit };

class DeviceMlp {
 public:
  explicit DeviceMlp(const FusedMlp& mlp);
  // Sets other weights of the same shapes.
  void Set(const FusedMlp& mlp);

  // output [n, ends] of input [n, ends], see FusedMlp; both on the device. `counted`, if not
  // null, is on the device, too: then n is the capacity and *counted the number of rows.
  void Forward(MlpPrecision precision, const float* input, int64_t n, float* output,
               const int32_t* counted = nullptr) const;

  // Adds the adjoint for d_output [n, ends] to sums that TakeGradient returns and
  // resets to zero. The forward pass is recomputed chunk by chunk, so memory does not grow with
  // n. Sums have a fixed order, which depends on the number of rows meant and not on n.
  void AddAdjoint(MlpPrecision precision, const float* input, const float* d_output, int64_t n,
                  const int32_t* counted = nullptr);
  void ReserveAdjoint(int64_t n);                     // allocates its memory beforehand
  void TakeGradient(DenseNetwork<double>* gradient);  // adds to it; the unpadded shapes

  // For training on the device, in the layout of FusedMlp::Offset: the current weights, and the
  // gradient sums so far.
  float* parameters() { return parameters_.data(); }
  const DeviceBuffer<double>& gradient() const { return gradient_; }
  int64_t ParameterOffset(size_t layer) const { return shape_.Offset(layer); }

 private:
  FusedMlp shape_;                       // its weights are unused
  DeviceBuffer<float> parameters_;       // in the layout of FusedMlp::Offset
  DeviceBuffer<double> gradient_;        // the same
  DeviceBuffer<float> scratch_, parts_;  // see device_mlp.cu
};

}  // namespace regrade
