// 2D methods that are networks: PCA-KD (Chiu and Gurari 2022), WCT (Li et al. 2017), WCT2,
// CCPL and CAP-VSTNet, from the segments that their published weights were converted to.
#pragma once

#include <memory>
#include <string>

#include "stylize/image/view_stylizer.h"

namespace regrade {

// `path` is a folder, or an encoder in it, and what lies there tells the method:
//   encoder.onnx (image -> f1..f4, s1..s4), decoder1..4.onnx (feat, skip -> out): PCA-KD.
//     x = f4; for L = 4..1: x <- decoderL(T_L(x), sL), T_L see EQ(whitening-coloring) with
//     ridge 1 onto the style's fL. Clipped to [0, 1], then its colours are given the photo's
//     edges: EQ(guided-filter) with radius 30 and eps 0.02^2, as for the published pictures.
//   encoder1..3.onnx (image -> feat), decoder1..3.onnx (feat -> image): WCT from level 3 down.
//     x = photo; for L = 3..1: x <- decoderL(0.6 W(f) + 0.4 f), f = encoderL(x), W without a
//     ridge, eigenvalues up to 1e-5 dropped. Clipped; no filter: painterly.
//   wct2_cat5_encoder1.onnx or wct2_sum_encoder1.onnx and so on: WCT2, see wct2_stylizer.h.
//   ccpl_encoder.onnx and so on: CCPL, see ccpl_stylizer.h.
//   capvst_encoder.onnx and capvst_decoder.onnx: CAP-VSTNet, see capvst_stylizer.h.
// PCA-KD and WCT work at the photo's size, or with its longer side cut to `max_side` pixels;
// PCA-KD's sides are cut to multiples of 8 or 16, whatever its encoder halves to, and of 16 at
// least. PCA-KD's result is brought to the photo's size by the filter, whose coefficients are
// enlarged and meet the photo's own detail; WCT's is enlarged itself (bilinear). The style
// picture is cut the same way.
//
// The networks are tried on a small picture first. Throws Error(kExternalProgram) that names
// the file for one that is missing, is not ONNX, lacks an output or gives another shape.
std::unique_ptr<ViewStylizer> MakeOnnxStylizer(const std::string& path, int max_side,
                                               const Image& style);

}  // namespace regrade
