// A radiance field: a Geometry, frozen once fitted, and spherical harmonics (Appearance, which
// a style changes). The geometry is a sparse voxel grid of densities, as of Plenoxels, or
// Gaussian splats.
#pragma once

#include <cstdint>
#include <memory>

#include "kernels/base/buffer.h"
#include "kernels/base/vec.h"
#include "kernels/field/grid_frame.h"
#include "kernels/field/march_options.h"

namespace regrade {

inline constexpr int kMaxLayers = 512;
inline constexpr int kMaxSphereResolution = 4096;

// The geometry of the background's layers, see background_spheres.h. Nothing is allocated for a
// scene without them.
struct SphereGeometry {
  int layers = 0;         // L; 0: no background spheres
  int resolution = 0;     // R: a layer's map has 2R x R texels
  Buffer<int32_t> links;  // [2R, R]: column of a texel, or -1 where nothing is stored
  Buffer<float> density;  // [columns, L]: per unit of inverse radius and world unit of length

  bool on() const { return layers > 0; }
  int64_t num_texels() const { return density.size(); }
  int64_t num_columns() const { return on() ? density.size() / layers : 0; }
};

// Splats in place of voxels: all of them but their colours, in the units of Splat
// (kernels/splats/splats.h).
struct SplatGeometry {
  Buffer<float> mean, log_scale;  // [N, 3]
  Buffer<float> quaternion;       // [N, 4]
  Buffer<float> opacity_logit;    // [N]
  float fit_pixel = -1;           // see SplatOptions

  bool on() const { return opacity_logit.size() > 0; }
};

// Records are what has a colour: voxels or splats. A grid has links, one per vertex of the
// frame; of splats the frame is the box that the cameras look at, without voxels, and some lie
// outside of it.
struct Geometry {
  GridFrame frame;
  Buffer<int32_t> links;  // [X, Y, Z]: voxel index, or -1 where nothing is stored
  Buffer<float> density;  // [N]: per world unit of length; negative means empty (ReLU)
  SphereGeometry spheres;
  SplatGeometry splats;

  // Records: a field has one kind of them.
  int64_t num_voxels() const { return density.size() + splats.opacity_logit.size(); }
};

struct Appearance {
  int basis = 9;               // spherical harmonics per channel: 1, 4 or 9; of splats 16, too
  Buffer<float> sh;            // [N, 3, basis]: channel-major, R then G then B
  Buffer<float> sphere_color;  // [columns, L, 3]: of degree 0; empty without spheres

  int stride() const { return 3 * basis; }
};

// Geometry is shared and const, so a restyled field has the same geometry by type.
struct RadianceField {
  std::shared_ptr<const Geometry> geometry;
  Appearance appearance;
  Vec3f background{0, 0, 0};  // sRGB, visible where transmittance remains
  float near_clip = 0;        // world units along the ray, for rendering and fitting
  MarchOptions march;         // for rendering and styling; splats need none
};

// Throws Error(kInput) naming the defect: inconsistent sizes, a link out of range (F68),
// non-finite values (F69).
void Validate(const RadianceField& field, const char* name);

template <typename T>
struct SpheresView {
  int layers = 0;
  int resolution = 0;
  const int32_t* links = nullptr;
  const T* density = nullptr;
  const T* color = nullptr;
};

// A non-owning view for kernel bodies, with any scalar type.
template <typename T>
struct FieldView {
  GridFrame frame;
  const int32_t* links = nullptr;
  const T* density = nullptr;
  const T* sh = nullptr;
  int basis = 9;
  Vec3<T> background{};
  T near_clip = 0;
  SpheresView<T> spheres{};
};

FieldView<float> ViewOf(const RadianceField& field);

}  // namespace regrade
