// PLY files of Gaussians in the layout of Kerbl et al.'s program (graphdeco-inria's
// gaussian-splatting, GaussianModel.save_ply), which most trainers write.
//
// Element vertex: x y z, f_dc_0..2, f_rest_* (the other harmonics of red, then green, then
// blue; 0, 9, 24 or 45 for the degrees 0 to 3), opacity (its logit), scale_0..2 (logarithms),
// rot_0..3 (w x y z, of any length), in any order and of any type. Axes: x right, y down,
// z front, as in the world of the cameras.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/fields/colored_splat.h"
#include "pipeline/fields/ply_header.h"
#include "pipeline/fields/ply_rows.h"

namespace regrade {

// Which properties of element `vertex` make a splat.
struct GaussianLayout {
  size_t vertex = 0;  // index of the element
  int basis = 1;
  // x y z, scale_0..2, rot_0..3, opacity, and from kFirstHarmonic on the harmonics [3, basis],
  // all coefficients of red first.
  std::vector<size_t> property;
};
inline constexpr size_t kFirstHarmonic = 11;

// Throws Error(kInput) with `where`, naming the properties that are missing.
GaussianLayout FindGaussians(const PlyHeader& header, const std::string& where);

// The current row. Throws Error(kInput) for a word that is no number.
ColoredSplat RecordOf(const PlyRows& rows, const GaussianLayout& layout);

// The whole file. Throws Error(kInput), see ReadSplats.
SplatScene ReadGaussianPly(std::string_view bytes, const PlyHeader& header, uint64_t budget,
                           const std::string& where);

// What a header's comments say about the filter of Mip-Splatting: Brush writes
// "SplatRenderMode: mip", Postshot "antialiased 1". The last such comment counts.
bool SaysAntialiased(const PlyHeader& header);

// The lines of a header with `comment`, and with what SaysAntialiased looks for.
std::string CommentLines(const std::string& comment, bool antialiased);

}  // namespace regrade
