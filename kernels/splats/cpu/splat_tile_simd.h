// Body of a tile, compiled once per instruction set: define REGRADE_SIMD_NAMESPACE before
// including it. See EQ(splat-composite) and EQ(splat-composite-adjoint).
#include <algorithm>
#include <cstring>

#include "kernels/field/cpu/opacity_simd.h"
#include "kernels/splats/compositing.h"
#include "kernels/splats/cpu/splat_tile.h"

namespace regrade::REGRADE_SIMD_NAMESPACE {
namespace {

// A vector of pixels is a part of a tile, 4 pixels wide: small splats meet fewer squares than
// rows.
constexpr int kPartWidth = 4, kPartHeight = kWide / kPartWidth;
constexpr int kPartsInRow = kSplatTile / kPartWidth;
constexpr int kParts = kSplatTile / kPartHeight * kPartsInRow;  // of a tile, by rows

// Columns and rows of a part's pixels.
inline Wide PartX() {
  return __builtin_convertvector(__builtin_convertvector(Ramp(), WideInt) & 3, Wide);
}
inline Wide PartY() {
  return __builtin_convertvector(__builtin_convertvector(Ramp(), WideInt) >> 2, Wide);
}
// Part and lane of a pixel of the tile.
inline int PartOf(int x, int y) { return y / kPartHeight * kPartsInRow + x / kPartWidth; }
inline int LaneOf(int x, int y) { return y % kPartHeight * kPartWidth + x % kPartWidth; }

// A splat as seen from a tile's upper left pixel.
struct TileSplat {
  float dx, dy, c10, inverse00, inverse11, log_opacity, reach, z;
  Vec3f color;
  int first_row, end_row, first_column, end_column;  // of parts that the splat's box meets

  TileSplat(const SplatFrame& frame, int32_t k, int x0, int y0) {
    const SeenSplat<float>& seen = frame.seen[static_cast<size_t>(k)];
    const PixelBox& box = frame.box[static_cast<size_t>(k)];
    dx = static_cast<float>(x0 + 0.5 - seen.ellipse.u);
    dy = static_cast<float>(y0 + 0.5 - seen.ellipse.v);
    c10 = seen.ellipse.c10;
    inverse00 = 1 / seen.ellipse.c00;
    inverse11 = 1 / seen.ellipse.c11;
    log_opacity = seen.log_opacity;
    reach = seen.reach;
    z = seen.z;
    color = seen.color;
    first_row = std::max(box.y0 - y0, 0) / kPartHeight;
    end_row = (std::min(box.y1 - y0, kSplatTile) + kPartHeight - 1) / kPartHeight;
    first_column = std::max(box.x0 - x0, 0) / kPartWidth;
    end_column = (std::min(box.x1 - x0, kSplatTile) + kPartWidth - 1) / kPartWidth;
  }

  // w of the pixels of a part.
  void Whiten(int part, Wide* w0, Wide* w1) const {
    const Wide across = PartX() + (dx + static_cast<float>(part % kPartsInRow * kPartWidth));
    const Wide down = PartY() + (dy + static_cast<float>(part / kPartsInRow * kPartHeight));
    *w0 = across * inverse00;
    *w1 = (down - c10 * *w0) * inverse11;
  }

  // alpha where the pixels of `which` see the splat, 0 elsewhere; false if none does.
  bool Alpha(int part, const WideInt& which, Wide* alpha) const {
    Wide w0, w1;
    Whiten(part, &w0, &w1);
    const Wide q = w0 * w0 + w1 * w1;
    const WideInt hit = (q <= Fill(reach)) & which;
    if (!AnyOf(hit)) return false;
    const Wide most = Fill(static_cast<float>(kMaxAlpha));
    const Wide full = Extinguish(q * 0.5f - log_opacity).decay;
    const Wide limited = full < most ? full : most;
    *alpha = hit ? limited : Wide{};
    return true;
  }
};

// The pixels of a tile, part by part.
struct TilePixels {
  Wide transmittance[kParts], red[kParts], green[kParts], blue[kParts], depth[kParts],
      median[kParts];
  WideInt alive[kParts];  // -1: not ended, and within the picture
  int parts_alive = 0;

  TilePixels(int columns, int rows) {
    for (int p = 0; p < kParts; ++p) {
      transmittance[p] = Fill(1);
      red[p] = green[p] = blue[p] = depth[p] = median[p] = Wide{};
      const float wide = static_cast<float>(columns - p % kPartsInRow * kPartWidth);
      const float high = static_cast<float>(rows - p / kPartsInRow * kPartHeight);
      alive[p] = (PartX() < Fill(wide)) & (PartY() < Fill(high));
      parts_alive += AnyOf(alive[p]);
    }
  }

  // Composites a splat at part p; *alpha becomes 0 where the pixel ends before it.
  void Composite(const TileSplat& splat, int p, Wide* alpha) {
    const Wide t = transmittance[p], after = t * (1.0f - *alpha);
    const WideInt ends = (after < Fill(static_cast<float>(kMinTransmittance))) & alive[p];
    if (AnyOf(ends)) {
      *alpha = ends ? Wide{} : *alpha;
      alive[p] &= ~ends;
      parts_alive -= !AnyOf(alive[p]);
    }
    const Wide left = ends ? t : after, weight = t * *alpha;
    red[p] += weight * splat.color.x;
    green[p] += weight * splat.color.y;
    blue[p] += weight * splat.color.z;
    depth[p] += weight * splat.z;
    const Wide half = Fill(0.5f);
    median[p] = (t > half) & (left <= half) ? Fill(splat.z) : median[p];
    transmittance[p] = left;
  }
};

struct TilePlace {
  int x0, y0, columns, rows;

  TilePlace(const SplatFrame& frame, int tile)
      : x0(tile % frame.tiles_x * kSplatTile),
        y0(tile / frame.tiles_x * kSplatTile),
        columns(std::min(kSplatTile, frame.camera.width - x0)),
        rows(std::min(kSplatTile, frame.camera.height - y0)) {}
};

// Calls before(part, alpha) where a splat is seen, and after that composites it; front to back.
template <typename Seen>
void ForwardTile(const SplatFrame& frame, int tile, const TilePlace& place, TilePixels* pixels,
                 const Seen& seen) {
  const int64_t first = frame.first_entry[static_cast<size_t>(tile)];
  const int64_t end = frame.first_entry[static_cast<size_t>(tile) + 1];
  for (int64_t e = first; e < end && pixels->parts_alive > 0; ++e) {
    const TileSplat splat(frame, frame.entry_splat[static_cast<size_t>(e)], place.x0, place.y0);
    for (int row = splat.first_row; row < splat.end_row; ++row)
      for (int column = splat.first_column; column < splat.end_column; ++column) {
        const int p = row * kPartsInRow + column;
        Wide alpha;
        if (!splat.Alpha(p, pixels->alive[p], &alpha)) continue;
        const Wide before = pixels->transmittance[p];
        pixels->Composite(splat, p, &alpha);
        seen(static_cast<int32_t>(e - first), p, before, alpha);
      }
  }
}

void RenderTile(const SplatFrame& frame, int tile, SplatPicture<float>* picture) {
  const TilePlace place(frame, tile);
  TilePixels pixels(place.columns, place.rows);
  ForwardTile(frame, tile, place, &pixels, [](int32_t, int, const Wide&, const Wide&) {});
  const Vec3f& background = frame.splats.background;
  for (int row = 0; row < place.rows; ++row)
    for (int x = 0; x < place.columns; ++x) {
      const int p = PartOf(x, row), lane = LaneOf(x, row);
      const size_t at = static_cast<size_t>(place.y0 + row) * picture->width + place.x0 + x;
      const float t = pixels.transmittance[p][lane];
      picture->color[3 * at] = pixels.red[p][lane] + background.x * t;
      picture->color[3 * at + 1] = pixels.green[p][lane] + background.y * t;
      picture->color[3 * at + 2] = pixels.blue[p][lane] + background.z * t;
      picture->depth[at] = pixels.depth[p][lane];
      picture->median_depth[at] = pixels.median[p][lane];
      picture->transmittance[at] = t;
    }
}

// The gradient by a tile's pixels; 0 beyond the picture. Lanes of floats.
struct TileGradient {
  Wide red[kParts], green[kParts], blue[kParts], depth[kParts], transmittance[kParts];

  TileGradient(const TilePlace& place, const SplatPicture<float>& d) {
    alignas(64) float lanes[5][kParts][kWide] = {};
    for (int row = 0; row < place.rows; ++row)
      for (int x = 0; x < place.columns; ++x) {
        const int p = PartOf(x, row), lane = LaneOf(x, row);
        const size_t at = static_cast<size_t>(place.y0 + row) * d.width + place.x0 + x;
        for (int c = 0; c < 3; ++c) lanes[c][p][lane] = d.color[3 * at + c];
        lanes[3][p][lane] = d.depth[at];
        lanes[4][p][lane] = d.transmittance[at];
      }
    std::memcpy(red, lanes[0], sizeof red);
    std::memcpy(green, lanes[1], sizeof green);
    std::memcpy(blue, lanes[2], sizeof blue);
    std::memcpy(depth, lanes[3], sizeof depth);
    std::memcpy(transmittance, lanes[4], sizeof transmittance);
  }
};

// Sums of a splat over a tile's pixels, lane by lane.
struct WideSums {
  Wide h0{}, h1{}, h00{}, h01{}, h11{}, f{}, red{}, green{}, blue{}, z{};

  void AddTo(SplatSums<float>* sums) const {
    const Quad first = SumEach(h0, h1, h00, h01), second = SumEach(h11, f, red, green);
    sums->ellipse.h[0] += first[0];
    sums->ellipse.h[1] += first[1];
    sums->ellipse.H[0] += first[2];
    sums->ellipse.H[1] += first[3];
    sums->ellipse.H[2] += second[0];
    sums->ellipse.f += second[1];
    sums->color += Vec3f{second[2], second[3], SumOf(FoldToQuad(blue))};
    sums->z += SumOf(FoldToQuad(z));
  }
};

// What is behind the current splat, see EQ(splat-composite-adjoint).
struct TileBehind {
  Wide red[kParts], green[kParts], blue[kParts], depth[kParts], clear[kParts];

  explicit TileBehind(const Vec3f& background) {
    for (int p = 0; p < kParts; ++p) {
      red[p] = Fill(background.x), green[p] = Fill(background.y), blue[p] = Fill(background.z);
      depth[p] = Wide{}, clear[p] = Fill(1);
    }
  }

  void Step(const TileSplat& splat, int p, Wide t, Wide alpha, const TileGradient& d,
            WideSums* sums) {
    const Wide by_alpha =
        t * ((splat.color.x - red[p]) * d.red[p] + (splat.color.y - green[p]) * d.green[p] +
             (splat.color.z - blue[p]) * d.blue[p] + (splat.z - depth[p]) * d.depth[p] -
             clear[p] * d.transmittance[p]);
    const Wide most = Fill(static_cast<float>(kMaxAlpha));
    const Wide g = alpha < most ? alpha * by_alpha : Wide{};
    const Wide through = 1.0f - alpha;
    red[p] = splat.color.x * alpha + red[p] * through;
    green[p] = splat.color.y * alpha + green[p] * through;
    blue[p] = splat.color.z * alpha + blue[p] * through;
    depth[p] = splat.z * alpha + depth[p] * through;
    clear[p] *= through;
    Wide w0, w1;
    splat.Whiten(p, &w0, &w1);
    // Lanes that do not see the splat may be far from it.
    const Wide g0 = g * w0, g1 = g * w1, weight = t * alpha;
    sums->f += g;
    sums->h0 += g0;
    sums->h1 += g1;
    sums->h00 += g0 * w0;
    sums->h01 += g0 * w1;
    sums->h11 += g1 * w1;
    sums->red += weight * d.red[p];
    sums->green += weight * d.green[p];
    sums->blue += weight * d.blue[p];
    sums->z += weight * d.depth[p];
  }
};

void AdjointTile(const SplatFrame& frame, int tile, const SplatPicture<float>& d_picture,
                 SplatTape* tape, SplatSums<float>* sums, Vec3f* d_background) {
  const TilePlace place(frame, tile);
  tape->Reserve(frame, tile);
  float* const kept_t = tape->transmittance.data();
  float* const kept_alpha = tape->alpha.data();
  int32_t* const entry = tape->entry.data();
  int32_t* const part = tape->part.data();
  int64_t items = 0;
  TilePixels pixels(place.columns, place.rows);
  ForwardTile(frame, tile, place, &pixels,
              [&](int32_t e, int p, const Wide& t, const Wide& alpha) {
                std::memcpy(kept_t + items * kWide, &t, sizeof t);
                std::memcpy(kept_alpha + items * kWide, &alpha, sizeof alpha);
                entry[items] = e;
                part[items++] = p;
              });
  const TileGradient d(place, d_picture);
  Wide red{}, green{}, blue{};
  for (int p = 0; p < kParts; ++p) {
    red += pixels.transmittance[p] * d.red[p];
    green += pixels.transmittance[p] * d.green[p];
    blue += pixels.transmittance[p] * d.blue[p];
  }
  *d_background +=
      Vec3f{SumOf(FoldToQuad(red)), SumOf(FoldToQuad(green)), SumOf(FoldToQuad(blue))};
  TileBehind behind(frame.splats.background);
  const int64_t first = frame.first_entry[static_cast<size_t>(tile)];
  while (items > 0) {
    const int32_t e = entry[items - 1];
    const size_t at = static_cast<size_t>(first + e);
    const TileSplat splat(frame, frame.entry_splat[at], place.x0, place.y0);
    WideSums own;
    for (; items > 0 && entry[items - 1] == e; --items) {
      Wide t, alpha;
      std::memcpy(&t, kept_t + (items - 1) * kWide, sizeof t);
      std::memcpy(&alpha, kept_alpha + (items - 1) * kWide, sizeof alpha);
      behind.Step(splat, part[items - 1], t, alpha, d, &own);
    }
    own.AddTo(&sums[frame.entry_slot[at]]);
  }
}

}  // namespace

extern const SplatTileFunctions kSplatTiles;
const SplatTileFunctions kSplatTiles = {REGRADE_SIMD_NAME, RenderTile, AdjointTile};

}  // namespace regrade::REGRADE_SIMD_NAMESPACE
