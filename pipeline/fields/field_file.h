// Reads and writes field.npz: a radiance field in the layout of svox2's
// checkpoints, with additional arrays.
//
// svox2's: radius f32[3], center f32[3], links i32[X,Y,Z], density_data f32[N,1], sh_data
// f16[N,27], basis_type i64 (1: spherical harmonics); with background spheres
// background_links i32[2R,R], background_data f32[columns,L,4]. Colours of a lower degree are
// padded with zeros to 9 harmonics a channel; those of splats of degree 3 have 48 columns.
// Additional: regrade_version i32, regrade_basis
// i32, regrade_background f32[3], regrade_near_clip f32, regrade_step f32 (voxels),
// regrade_stop f32, regrade_field_from_world f64[13] (scale, rotation by rows, translation),
// regrade_ndc f64[2] where the field is in normalised device coordinates (ndc.h).
//
// A field of splats has neither links nor density_data: in their place are
// regrade_splats_mean f32[N,3], regrade_splats_log_scale f16[N,3], regrade_splats_quaternion
// f16[N,4] (unit length), regrade_splats_opacity_logit f16[N] and regrade_splats_fit_pixel
// f32, see SplatGeometry; radius and center are those of the box that the cameras look at.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/scene/camera.h"
#include "pipeline/fields/kept_records.h"

namespace regrade {

struct StoredField {
  RadianceField field;
  // From the frame of the capture's cameras to the field's.
  Similarity field_from_world;
  NdcSpace ndc;         // on where the field's frame is that of a forward-facing capture's NDC
  KeptRecords records;  // of the file that it was read from
};

// Colours are rounded to half precision (to nearest, ties to even; beyond its range to the
// largest half), and so are splats but for their means: read the file back before using the
// field further, so that every stage gets the values that a later run would get. Equal fields
// give equal bytes. Needs a few megabytes of memory besides the field, of splats 16 B a splat.
// regrade_version is 1 of voxels and 3 of splats.
// Throws Error(kResources).
void WriteFieldFile(const std::string& path, const StoredField& stored);

// Rounds colours as a file stores them.
void RoundAsStored(Appearance* appearance);

// Reads our files and svox2's (with its older key `data` and links below -1, too). A field of
// svox2 gets a white background, svox2's default: its file has no entry for it. Throws
// Error(kInput) for files that are damaged, larger than `budget` bytes, from a newer version of
// this program, or not renderable (learned bases). The field has passed Validate.
inline constexpr uint64_t kMostField = uint64_t{256} << 30;
StoredField ReadFieldFile(const std::string& path, uint64_t budget = kMostField);

// How many splats a file has; 0 of voxels.
int64_t CountSplats(const std::string& path);

// Which splats [splats] are kept, of a field without colours.
using SplatFilter = std::function<std::vector<uint8_t>(const RadianceField& field)>;

// The splats that `keep` chooses, with their colours: no others' colours are in memory, and
// their geometry, 56 B a splat, only while the file is read. Where none is chosen, the first is
// kept. Voxels are read whole.
StoredField ReadPartOfField(const std::string& path, const SplatFilter& keep);

// Splats whose colours are one coefficient a channel, 0. Voxels are read whole.
StoredField ReadFieldGeometry(const std::string& path);

}  // namespace regrade
