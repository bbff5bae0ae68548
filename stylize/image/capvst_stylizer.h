// CAP-VSTNet (Wen et al. 2023): a reversible network, between whose two ways features are
// whitened and coloured.
#pragma once

#include <memory>
#include <string>

#include "stylize/image/view_stylizer.h"

namespace regrade {

// The folder holds capvst_encoder.onnx (image -> code) and capvst_decoder.onnx (code -> image),
// the two ways of one network, as scripts/convert_networks.py makes them of the photorealistic
// model (32 channels at the picture's size) or of the artistic one (128 at half of it). A photo
// becomes decoder(W(encoder(photo))), W see EQ(cholesky-coloring), onto what the encoder makes
// of the style picture.
//
// Works at the photo's size, its edges reflected to multiples of 4, and has no filter then; a
// photo whose longer side is above `max_side` is worked on small and its result brought to the
// photo's size and edges by WithEdgesOf. The networks are tried on a small picture first; what
// does not fit is Error(kExternalProgram) naming the file.
std::unique_ptr<ViewStylizer> MakeCapVstStylizer(const std::string& folder, int max_side,
                                                 const Image& style);

// By which a folder is recognised.
inline constexpr char kCapVstFirstFile[] = "capvst_encoder.onnx";

}  // namespace regrade
