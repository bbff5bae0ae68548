// WCT2 (Yoo et al. 2019), whose networks halve pictures by Haar wavelets, which lose nothing.
#pragma once

#include <memory>
#include <string>

#include "stylize/image/view_stylizer.h"

namespace regrade {

// The networks, a half of VGG-19 and its mirror image, in the segments between which features
// are transformed, as scripts/convert_networks.py cuts them. Two versions were published, with
// files wct2_cat5_encoder1.onnx ... 4 and wct2_cat5_decoder1.onnx ... 4, or wct2_sum_...:
//   cat5  encoder 1 gives out; 2 to 4 give out, skip, lh, hl, hh; decoders 4 to 2 take those
//         of their own number
//   sum   encoders 1 to 3 give out, lh, hl, hh; 4 gives out; decoders 4 to 2 take lh, hl, hh
//         of the encoder before
// All take "feat" (encoder 1: "image") and give "out" (decoder 1: "image").
//   x = photo; for L = 1..4: x <- W(encoderL(x)); the nine maps lh, hl, hh <- W; then
//   x <- decoder4(x), and for L = 3..1: x <- decoderL(W(x)) with cat5, decoderL(x) with sum
// onto what the style picture, which is not transformed, has at the same place (the defaults
// and the "full stylization" of the authors' program). W is EQ(whitening-coloring) with ridge 1
// and covariances of n - 1, its values kept within the range of the content's own there.
//
// Works at the photo's size, its edges reflected to multiples of 8, and has no filter then; a
// photo whose longer side is above `max_side` is worked on small and its result brought to the
// photo's size and edges by WithEdgesOf. The style picture is cut and reflected the same way.
// The networks are tried on a small picture first; what does not fit is Error(kExternalProgram)
// naming the file.
std::unique_ptr<ViewStylizer> MakeWct2Stylizer(const std::string& folder, bool cat5,
                                               int max_side, const Image& style);

// By which a folder is recognised.
std::string Wct2FirstFile(bool cat5);

}  // namespace regrade
