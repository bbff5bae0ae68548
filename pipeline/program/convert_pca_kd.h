// PCA-KD's published weights as the ONNX files that `--method onnx:DIR` reads.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "pipeline/program/tensor_bundle.h"

namespace regrade {

// Named contents of encoder.onnx and decoder1.onnx ... decoder4.onnx, see onnx_stylizer.h, of
// the students with MobileNet's layers (Chiu and Gurari 2022). Encoder: a convolution and
// eleven convolutions of single channels or single pixels, rectified, in four blocks that halve
// the sides; beside each block what its input has beyond the mean of 3 x 3 pixels. Decoders:
// twice the size (bilinear), convolution, the encoder's detail added, convolution. The original
// stretches pictures to [-1, 1]; that is put into the first convolution here.
//
// Throws Error(kInput) naming `where` for a tensor that is missing or has another shape.
std::vector<std::pair<std::string, std::string>> ConvertPcaKd(const TensorBundle& encoder,
                                                              const TensorBundle& decoder,
                                                              const std::string& where);

}  // namespace regrade
