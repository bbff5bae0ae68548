#include "kernels/field/radiance_field.h"

#include <cmath>
#include <string>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/field/field_kind.h"
#include "kernels/field/spherical_harmonics.h"

namespace regrade {
namespace {

[[noreturn]] void Refuse(const char* name, const std::string& defect) {
  throw Error(ExitCode::kInput, defect, name,
              "the file is damaged or was not written by a radiance field program");
}

int64_t CountNonFinite(const Buffer<float>& values) {
  int64_t count = 0;
  for (const float value : values) count += !std::isfinite(value);
  return count;
}

void CheckFrame(const GridFrame& frame, int least_side, const char* name) {
  for (int a = 0; a < 3; ++a) {
    if (frame.resolution[a] < least_side)
      Refuse(name, "the grid has " + std::to_string(frame.resolution[a]) +
                       " vertices along an axis, at least " + std::to_string(least_side) +
                       " are needed");
    if (!(frame.radius[a] > 0) || !std::isfinite(frame.radius[a]) ||
        !std::isfinite(frame.center[a]))
      Refuse(name, "the box has a radius or centre that is not a finite, positive length");
  }
}

// One pass: a link out of range would be an access out of bounds, and a voxel shared by two
// vertices would be stepped twice.
void CheckLinks(const Geometry& geometry, const char* name) {
  const int64_t voxels = geometry.num_voxels();
  std::vector<bool> taken(static_cast<size_t>(voxels), false);
  for (int64_t i = 0; i < geometry.links.size(); ++i) {
    const int64_t link = geometry.links[i];
    if (link == -1) continue;
    if (link < -1 || link >= voxels)
      Refuse(name, "link " + std::to_string(i) + " is " + std::to_string(link) +
                       ", but there are " + std::to_string(voxels) + " voxels");
    if (taken[static_cast<size_t>(link)])
      Refuse(name, "voxel " + std::to_string(link) + " belongs to two vertices");
    taken[static_cast<size_t>(link)] = true;
  }
}

void CheckSpheres(const Geometry& geometry, const Buffer<float>& color, const char* name) {
  const SphereGeometry& spheres = geometry.spheres;
  if (!spheres.on()) {
    if (spheres.layers < 0 || spheres.density.size() > 0 || color.size() > 0)
      Refuse(name, "the background has no layers");
    return;
  }
  if (spheres.layers > kMaxLayers || spheres.resolution < 2 ||
      spheres.resolution > kMaxSphereResolution)
    Refuse(name, "a background of " + std::to_string(spheres.layers) + " layers and " +
                     std::to_string(spheres.resolution) +
                     " texels from pole to pole; at most " + std::to_string(kMaxLayers) +
                     " and " + std::to_string(kMaxSphereResolution) + " are supported");
  const int64_t map = int64_t{2} * spheres.resolution * spheres.resolution;
  if (map * spheres.layers > INT32_MAX ||
      geometry.num_voxels() + spheres.density.size() > INT32_MAX ||
      spheres.links.size() != map || spheres.density.size() % spheres.layers != 0 ||
      color.size() != 3 * spheres.density.size())
    Refuse(name, "the sizes of the background's arrays disagree");
  for (const int32_t link : spheres.links)
    if (link < -1 || link >= spheres.num_columns())
      Refuse(name, "a background texel links to column " + std::to_string(link) + " of " +
                       std::to_string(spheres.num_columns()));
  if (CountNonFinite(spheres.density) + CountNonFinite(color) > 0)
    Refuse(name, "values of the background are not finite");
}

}  // namespace

void Validate(const RadianceField& field, const char* name) {
  if (field.geometry == nullptr) Refuse(name, "the grid is missing");
  const Geometry& geometry = *field.geometry;
  const FieldKind& kind = KindOf(geometry);
  CheckFrame(geometry.frame, kind.least_side, name);
  if (const std::string defect = kind.defect_of(geometry); !defect.empty())
    Refuse(name, defect);
  const SplatGeometry& splats = geometry.splats;
  const int64_t bad_splats = CountNonFinite(splats.mean) + CountNonFinite(splats.log_scale) +
                             CountNonFinite(splats.quaternion) +
                             CountNonFinite(splats.opacity_logit);
  if (bad_splats > 0) Refuse(name, Concat(bad_splats, " values of splats are not finite"));
  const int basis = field.appearance.basis;
  if (!IsBasis(basis))
    Refuse(name, Concat(basis, " harmonics a channel; 1, 4, 9 or 16 are supported"));
  if (basis > kind.most_basis)
    Refuse(name,
           Concat(basis, " harmonics a channel; of ", kind.name, " 1, 4 or 9 are supported"));
  const int64_t expected = geometry.num_voxels() * field.appearance.stride();
  if (field.appearance.sh.size() != expected)
    Refuse(name, std::to_string(field.appearance.sh.size()) + " colour coefficients, " +
                     std::to_string(expected) + " expected");
  CheckLinks(geometry, name);
  CheckSpheres(geometry, field.appearance.sphere_color, name);
  const int64_t bad = CountNonFinite(geometry.density) + CountNonFinite(field.appearance.sh);
  if (bad > 0)
    Refuse(name, std::to_string(bad) + " values are not finite (of " +
                     std::to_string(geometry.num_voxels() * (1 + field.appearance.stride())) +
                     ")");
  if (!AllFinite(field.background) || !std::isfinite(field.near_clip) || field.near_clip < 0)
    Refuse(name, "the background colour or the near distance is not valid");
  if (!(field.march.step >= 0.01f && field.march.step <= 16))
    Refuse(name, "the step is " + std::to_string(field.march.step) +
                     " voxels, 0.01 to 16 are supported");
  if (!(field.march.stop_transmittance >= 0 && field.march.stop_transmittance <= 0.1f))
    Refuse(name, "the transmittance at which rays stop is not in [0, 0.1]");
}

FieldView<float> ViewOf(const RadianceField& field) {
  const SphereGeometry& spheres = field.geometry->spheres;
  return {field.geometry->frame,
          field.geometry->links.data(),
          field.geometry->density.data(),
          field.appearance.sh.data(),
          field.appearance.basis,
          field.background,
          field.near_clip,
          {spheres.layers, spheres.resolution, spheres.links.data(), spheres.density.data(),
           field.appearance.sphere_color.data()}};
}

}  // namespace regrade
