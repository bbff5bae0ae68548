// Frames of a film in fewer rays.
#pragma once

#include <cstdint>

#include "kernels/field/cpu/render_view.h"

namespace regrade {

// EQ(smooth-pixels): pixels of even x and even y are rendered; then those of odd x and odd y
// are found from their neighbours along the diagonals, and then the rest from those beside
// them. With the mean m of the four nearest neighbours and the mean f of the eight that are
// sqrt(5) times as far, a pixel is m + (m - f) / 4, exact up to third order. It is rendered
// instead where, in a channel of either picture (white = 1, clipped), the means of the two
// opposite pairs differ by more than `tolerance`, m and f by more than 3 and the four by more
// than 10 of it, or where a neighbour is outside the frame. Its depth and transmittance are one
// neighbour's.
//
// What is narrower than a pixel and meets no neighbour is lost. Deterministic.
struct FilmFrame {
  RenderedPair pair;
  int64_t rays = 0;  // rendered
};
FilmFrame RenderFilmFrame(const FastGrid& grid, const FastGrid& other, const Camera& camera,
                          const MarchOptions& options, float tolerance);

}  // namespace regrade
