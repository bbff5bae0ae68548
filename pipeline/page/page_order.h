// The order in which a page stores the voxels of a field, and what is stored of their places.
//
// A page leaves out what no ray can see: voxels around which no density is positive. The order
// lets a reader find places from few bytes, and keeps neighbours together, from which each
// voxel is predicted.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "kernels/field/radiance_field.h"

namespace regrade {

inline constexpr int kPageBrick = 8;          // voxels along the edge of a brick
inline constexpr int kMaxPageSide = 1 << 20;  // of the box, voxels
inline constexpr int64_t kMaxPageVoxels = int64_t{1} << 26;

// Up to three earlier voxels, numbered in the page's order; -1: fewer.
using EarlierRecords = std::array<int32_t, 3>;

struct PageOrder {
  std::vector<Vec3i> place;             // [V]: vertex of the grid
  std::vector<EarlierRecords> earlier;  // [V]
};

// A bit for each brick of kPageBrick^3 vertices (z fastest, the lowest bit first), and behind
// these bits 64 bytes for each brick whose bit is set: a bit for each vertex.
std::string MaskOfGrid(const Geometry& geometry);
// Throws Error(kInput) for bytes of another size.
PageOrder OrderOfMask(std::string_view mask, const Vec3i& voxels);

}  // namespace regrade
