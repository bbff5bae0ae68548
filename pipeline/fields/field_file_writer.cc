#include <algorithm>
#include <vector>

#include "kernels/base/half.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/files/npz_file.h"

namespace regrade {
namespace {

// Format 2 was of cells.
constexpr int32_t kVoxelsFormat = 1, kSplatsFormat = 3;
// Colours have 9 columns a channel, as svox2 has them, or the 16 of splats of degree 3.
constexpr int kLeastStored = 9;
constexpr int64_t kHarmonicsType = 1;  // svox2's basis_type

uint16_t StoredColour(float value) {
  return HalfFromFloat(std::clamp(value, -kMaxHalf, kMaxHalf));
}

int StoredBasis(const Appearance& appearance) {
  return std::max(appearance.basis, kLeastStored);
}

// Colours of records [first, first + count) in half precision, 3 x StoredBasis values each.
void PackColours(const Appearance& appearance, int64_t first, int64_t count, uint16_t* to) {
  const int stored = StoredBasis(appearance);
  std::fill_n(to, count * 3 * stored, uint16_t{0});
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < count; ++i)
    for (int channel = 0; channel < 3; ++channel)
      for (int k = 0; k < appearance.basis; ++k)
        to[(i * 3 + channel) * stored + k] =
            StoredColour(appearance.sh[((first + i) * 3 + channel) * appearance.basis + k]);
}

// Arrays that are made for the file, which WriteTo reads.
struct MadeArrays {
  std::vector<uint16_t> log_scale, quaternion, opacity_logit;
  std::vector<float> texels;
};

// svox2's arrays: links [2R, R], and by column and layer red, green, blue, density.
void AddSpheres(const RadianceField& field, MadeArrays* made, NpzWriter* file) {
  const SphereGeometry& spheres = field.geometry->spheres;
  if (!spheres.on()) return;
  made->texels.resize(4 * spheres.num_texels());
  for (int64_t i = 0; i < spheres.num_texels(); ++i) {
    float* const texel = made->texels.data() + 4 * i;
    std::copy_n(field.appearance.sphere_color.data() + 3 * i, 3, texel);
    texel[3] = spheres.density[i];
  }
  file->Add("background_links", {2 * spheres.resolution, spheres.resolution},
            spheres.links.data(), NpzPacking::kDeflate);
  file->Add("background_data", {spheres.num_columns(), spheres.layers, 4}, made->texels.data());
}

std::vector<uint16_t> Halves(const Buffer<float>& values) {
  std::vector<uint16_t> halves(static_cast<size_t>(values.size()));
  std::ranges::transform(values, halves.begin(), StoredColour);
  return halves;
}

void AddSplats(const SplatGeometry& splats, MadeArrays* made, NpzWriter* file) {
  const int64_t n = splats.opacity_logit.size();
  made->log_scale = Halves(splats.log_scale);
  made->quaternion = Halves(splats.quaternion);
  made->opacity_logit = Halves(splats.opacity_logit);
  file->Add("regrade_splats_mean", {n, 3}, splats.mean.data());
  file->Add("regrade_splats_log_scale", {n, 3}, made->log_scale.data());
  file->Add("regrade_splats_quaternion", {n, 4}, made->quaternion.data());
  file->Add("regrade_splats_opacity_logit", {n}, made->opacity_logit.data());
  file->AddScalar("regrade_splats_fit_pixel", splats.fit_pixel);
}

}  // namespace

void WriteFieldFile(const std::string& path, const StoredField& stored) {
  const RadianceField& field = stored.field;
  const Geometry& geometry = *field.geometry;
  const int64_t voxels = geometry.num_voxels();
  const Similarity& similarity = stored.field_from_world;
  double placement[13] = {similarity.scale};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) placement[1 + 3 * i + j] = similarity.rotation(i, j);
    placement[10 + i] = similarity.translation[i];
  }

  NpzWriter file;
  file.Add("radius", {3}, &geometry.frame.radius.x);
  file.Add("center", {3}, &geometry.frame.center.x);
  const bool splats = geometry.splats.on();
  MadeArrays made;  // read by the writer in WriteTo
  if (splats) {
    AddSplats(geometry.splats, &made, &file);
  } else {
    const Vec3i& n = geometry.frame.resolution;
    file.Add("links", {n.x, n.y, n.z}, geometry.links.data(), NpzPacking::kDeflate);
    file.Add("density_data", {voxels, 1}, geometry.density.data());
  }
  file.AddFilled<uint16_t>(
      "sh_data", {voxels, 3 * StoredBasis(field.appearance)},
      [&field](int64_t first, int64_t count, uint16_t* to) {
        PackColours(field.appearance, first, count, to);
      },
      field.appearance.basis >= kLeastStored ? NpzPacking::kStore : NpzPacking::kDeflate);
  file.AddScalar<int64_t>("basis_type", kHarmonicsType);
  file.AddScalar<int32_t>("regrade_version", splats ? kSplatsFormat : kVoxelsFormat);
  file.AddScalar<int32_t>("regrade_basis", field.appearance.basis);
  file.Add("regrade_background", {3}, &field.background.x);
  file.AddScalar<float>("regrade_near_clip", field.near_clip);
  file.AddScalar<float>("regrade_step", field.march.step);
  file.AddScalar<float>("regrade_stop", field.march.stop_transmittance);
  file.Add("regrade_field_from_world", {13}, placement);
  if (stored.ndc.on()) file.Add("regrade_ndc", {2}, &stored.ndc.a);
  AddSpheres(field, &made, &file);
  file.WriteTo(path);
}

void RoundAsStored(Appearance* appearance) {
  const int64_t n = appearance->sh.size();
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < n; ++i)
    appearance->sh[i] = FloatFromHalf(StoredColour(appearance->sh[i]));
}

}  // namespace regrade
