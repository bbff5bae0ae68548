#include "kernels/synthetic/procedural_texture.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/random.h"
#include "kernels/scene/srgb.h"

namespace regrade {
namespace {

// Random bits of one lattice cell.
uint64_t CellBits(uint64_t seed, int64_t i, int64_t j) {
  return MixBits(seed + 0xd6e8feb86659fd93ull * static_cast<uint64_t>(i) +
                 0xa0761d6478bd642full * static_cast<uint64_t>(j));
}

// The n-th of four 16-bit numbers in [0, 1) of a cell.
double Part(uint64_t bits, int n) {
  return static_cast<double>((bits >> (16 * n)) & 0xffff) * 0x1p-16;
}

Vec3d Mix(const Vec3d& a, const Vec3d& b, double t) { return a * (1 - t) + b * t; }

// Smooth value noise in [-1, 1] with unit cells.
double Noise(uint64_t seed, double u, double v) {
  const double fu = std::floor(u), fv = std::floor(v);
  const int64_t i = static_cast<int64_t>(fu), j = static_cast<int64_t>(fv);
  double a = u - fu, b = v - fv;
  a *= a * (3 - 2 * a), b *= b * (3 - 2 * b);
  const double n00 = Part(CellBits(seed, i, j), 0), n10 = Part(CellBits(seed, i + 1, j), 0);
  const double n01 = Part(CellBits(seed, i, j + 1), 0);
  const double n11 = Part(CellBits(seed, i + 1, j + 1), 0);
  const double low = n00 + a * (n10 - n00), high = n01 + a * (n11 - n01);
  return 2 * (low + b * (high - low)) - 1;
}

// Nearest and second nearest jittered lattice points (Worley 1996), unit cells.
struct Nearest {
  double first = 1e9, second = 1e9;  // distances
  uint64_t bits = 0;                 // of the nearest point's cell
};

Nearest FindNearest(uint64_t seed, double u, double v) {
  const int64_t i = static_cast<int64_t>(std::floor(u)),
                j = static_cast<int64_t>(std::floor(v));
  Nearest best;
  for (int64_t dj = -1; dj <= 1; ++dj)
    for (int64_t di = -1; di <= 1; ++di) {
      const uint64_t bits = CellBits(seed, i + di, j + dj);
      const double du = static_cast<double>(i + di) + 0.1 + 0.8 * Part(bits, 0) - u;
      const double dv = static_cast<double>(j + dj) + 0.1 + 0.8 * Part(bits, 1) - v;
      const double d2 = du * du + dv * dv;
      if (d2 < best.first) {
        best.second = best.first;
        best.first = d2;
        best.bits = bits;
      } else if (d2 < best.second) {
        best.second = d2;
      }
    }
  best.first = std::sqrt(best.first);
  best.second = std::sqrt(best.second);
  return best;
}

// One of the palette's four colours other than the ground.
const Vec3d& Accent(const Paint& paint, double part) {
  return paint.palette[1 + static_cast<int>(part * 4)];
}

Vec3d Terrazzo(const Paint& paint, double u, double v) {
  const double s = 1 / paint.size;
  const Nearest chip = FindNearest(paint.seed + 1, u * s, v * s);
  if (Part(chip.bits, 2) < 0.6 && chip.second - chip.first > 0.16)
    return Mix(paint.palette[0], Accent(paint, Part(chip.bits, 3)), 0.85);
  const Nearest small = FindNearest(paint.seed + 2, 2.3 * u * s, 2.3 * v * s);
  if (Part(small.bits, 2) < 0.3 && small.second - small.first > 0.22)
    return Mix(paint.palette[0], Accent(paint, Part(small.bits, 3)), 0.55);
  return paint.palette[0];
}

// Coordinates a, b are in [-1, 1].
bool InMotif(int motif, double a, double b) {
  switch (motif) {
    case 0:
      return a * a + b * b < 0.45;
    case 1:
      return std::abs(a) + std::abs(b) < 0.85;
    case 2:
      return std::hypot(a + 1, b + 1) < 1.05 || std::hypot(a - 1, b - 1) < 0.7;
    case 3:
      return a > b;
    case 4:
      return std::hypot(a - 1, b) < 0.8 || std::hypot(a + 1, b) < 0.8;
    case 5:
      return std::min(std::abs(a), std::abs(b)) < 0.27;
    default:
      return a > 0 && b < 0.35;
  }
}

Vec3d Tiles(const Paint& paint, double u, double v) {
  const double s = 1 / paint.size;
  const double fu = std::floor(u * s), fv = std::floor(v * s);
  const uint64_t bits =
      CellBits(paint.seed + 3, static_cast<int64_t>(fu), static_cast<int64_t>(fv));
  double a = 2 * (u * s - fu) - 1, b = 2 * (v * s - fv) - 1;
  if (std::max(std::abs(a), std::abs(b)) > 0.94) return paint.palette[0] * 0.8;
  const int turn = static_cast<int>(Part(bits, 0) * 4);
  for (int k = 0; k < turn; ++k) {
    const double old = a;
    a = -b, b = old;
  }
  const Vec3d ground = Mix(paint.palette[0], Accent(paint, Part(bits, 1)), 0.25);
  const Vec3d ink = Mix(ground, Accent(paint, Part(bits, 2)), 0.8);
  return InMotif(static_cast<int>(Part(bits, 3) * 7), a, b) ? ink : ground;
}

// Index of the irregular band that x lies in, unit mean width.
int64_t Band(uint64_t seed, double x) {
  const int64_t i = static_cast<int64_t>(std::floor(x));
  const double start = 0.75 * Part(CellBits(seed, i, 7), 0);
  return x - std::floor(x) < start ? i - 1 : i;
}

Vec3d Cloth(const Paint& paint, double u, double v) {
  const double s = 1 / paint.size;
  const int64_t i = Band(paint.seed + 4, u * s), j = Band(paint.seed + 5, v * s);
  const Vec3d warp = paint.palette[static_cast<int>(5 * Part(CellBits(paint.seed, i, 1), 1))];
  const Vec3d weft = paint.palette[static_cast<int>(5 * Part(CellBits(paint.seed, j, 2), 1))];
  const uint64_t bits = CellBits(paint.seed + 6, i, j);
  // Some patches get an accent colour, so that no two crossings look alike.
  if (Part(bits, 0) < 0.12) return Accent(paint, Part(bits, 1));
  return Mix(warp, weft, 0.35 + 0.3 * Part(bits, 2));
}

Vec3d Painting(const Paint& paint, double u, double v) {
  const double s = 0.5 / paint.size;
  const double wu = u * s + 0.6 * Noise(paint.seed + 7, u * s * 1.3, v * s * 1.3);
  const double wv = v * s + 0.6 * Noise(paint.seed + 8, u * s * 1.3, v * s * 1.3);
  const double height =
      Noise(paint.seed + 9, wu, wv) + 0.45 * Noise(paint.seed + 10, 2.2 * wu, 2.2 * wv);
  const int level = std::clamp(static_cast<int>(std::floor(2.5 + 3.4 * height)), 0, 4);
  return paint.palette[level];
}

Vec3d Dots(const Paint& paint, double u, double v) {
  const double s = 1 / paint.size;
  const Nearest spot = FindNearest(paint.seed + 11, u * s, v * s);
  const double radius = 0.12 + 0.3 * Part(spot.bits, 2);
  if (spot.first < radius) {
    const Vec3d ink = Accent(paint, Part(spot.bits, 3));
    return spot.first < 0.45 * radius ? Mix(ink, paint.palette[0], 0.6) : ink;
  }
  return paint.palette[0];
}

Vec3d Planks(const Paint& paint, double u, double v) {
  const double s = 1 / paint.size;
  const int64_t row = static_cast<int64_t>(std::floor(v * s));
  const int64_t board =
      Band(paint.seed + 12 + 31 * static_cast<uint64_t>(row & 0xffff), u * s * 0.4);
  const uint64_t bits = CellBits(paint.seed + 13, board, row);
  const Vec3d tone = Mix(paint.palette[static_cast<int>(5 * Part(bits, 0))], paint.palette[0],
                         0.4 * Part(bits, 1));
  const double grain = Noise(bits, u * s * 1.6, v * s * 7);
  // A knot on some boards.
  const Nearest knot = FindNearest(paint.seed + 14, u * s * 0.7, v * s * 0.7);
  const double dark = Part(knot.bits, 2) < 0.5 && knot.first < 0.14 ? 0.55 : 1.0;
  return tone * (dark * (1 + 0.14 * grain));
}

Vec3d PatternColor(const Paint& paint, double u, double v) {
  switch (paint.pattern) {
    case Pattern::kPlain:
      break;
    case Pattern::kTerrazzo:
      return Terrazzo(paint, u, v);
    case Pattern::kTiles:
      return Tiles(paint, u, v);
    case Pattern::kCloth:
      return Cloth(paint, u, v);
    case Pattern::kPainting:
      return Painting(paint, u, v);
    case Pattern::kDots:
      return Dots(paint, u, v);
    case Pattern::kPlanks:
      return Planks(paint, u, v);
  }
  return paint.palette[0];
}

}  // namespace

Vec3d LinearFromHex(uint32_t hex) {
  return {LinearFromSrgb(((hex >> 16) & 255) / 255.0),
          LinearFromSrgb(((hex >> 8) & 255) / 255.0), LinearFromSrgb((hex & 255) / 255.0)};
}

Vec3d Albedo(const Paint& paint, double u, double v) {
  const double coarse = Noise(paint.seed + 20, u / (6 * paint.detail), v / (6 * paint.detail));
  const double middle =
      Noise(paint.seed + 21, u / (2.4 * paint.detail), v / (2.4 * paint.detail));
  const double fine = Noise(paint.seed + 22, u / paint.detail, v / paint.detail);
  const double mottle = 1 + 0.10 * coarse + 0.10 * middle + 0.09 * fine;
  const Vec3d color = PatternColor(paint, u, v) * mottle;
  return {std::clamp(color.x, 0.0, 1.0), std::clamp(color.y, 0.0, 1.0),
          std::clamp(color.z, 0.0, 1.0)};
}

}  // namespace regrade
