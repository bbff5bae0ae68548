// What the kinds of fields differ in, where a caller would else ask which one it holds: voxels
// or splats.
#pragma once

#include <cstdint>
#include <string>

#include "kernels/field/radiance_field.h"
#include "kernels/field/ray_weights.h"

namespace regrade {

struct FieldKind {
  const char* name;         // of the records: "voxels" or "splats", as --field has it
  const char* far_records;  // what stands for far surroundings
  bool own_directions;      // each record is seen from a direction of its own, see RayWeights
  bool lenses;              // there is a picture through a lens; else cameras are pinholes
  bool lattice;             // records are vertices of a lattice within the box
  int sample_points;        // that a sample of a ray may blend, see CornerPoints
  int least_side;           // of the frame, in vertices
  int most_basis;           // spherical harmonics per channel

  // Of the sizes of a geometry's arrays, for Validate; or an empty text.
  std::string (*defect_of)(const Geometry& geometry);
  // Throws Error(kUsage) where there are no voxels.
  void (*require_voxels)();
  // See CornerPoints.
  void (*find_points)(const Geometry& geometry, const WeightedSample& sample, int32_t* point);
  // Of a record, [-1, 1] across the box; of splats see EQ(splat-position). `vertex`: the
  // record's place in Geometry::links; where there are none, the record.
  Vec3f (*position_of)(const Geometry& geometry, int64_t record, int32_t vertex);
};

const FieldKind& KindOf(const Geometry& geometry);

// "voxels" or "splats".
const FieldKind& KindNamed(const std::string& name);

}  // namespace regrade
