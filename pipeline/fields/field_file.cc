#include "pipeline/fields/field_file.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/base/half.h"
#include "kernels/field/spherical_harmonics.h"
#include "kernels/scene/camera_checks.h"
#include "pipeline/files/npz_file.h"

namespace regrade {
namespace {

// A grid of voxels has version 1; version 2 was of cells.
constexpr int32_t kCellsVersion = 2, kSplatsVersion = 3;
// Colours have 9 columns a channel, as svox2 has them, or the 16 of splats of degree 3.
constexpr int kLeastStored = 9;
constexpr int64_t kSphericalHarmonics = 1;  // svox2's basis_type

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

float ValueAt(const NpzArray& array, int64_t i) {
  return array.type == ArrayType::kF16 ? FloatFromHalf(array.As<uint16_t>()[i])
                                       : array.As<float>()[i];
}

// Colour columns [first, first + 3 * stored) of `array`, of which the first `basis` harmonics
// of each channel are kept.
Buffer<float> UnpackedColours(const NpzArray& array, int64_t first, int stored, int basis) {
  const int64_t voxels = array.shape[0], columns = array.shape[1];
  Buffer<float> sh(voxels * 3 * basis);
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < voxels; ++i)
    for (int channel = 0; channel < 3; ++channel)
      for (int k = 0; k < basis; ++k)
        sh[(i * 3 + channel) * basis + k] =
            ValueAt(array, i * columns + first + channel * stored + k);
  return sh;
}

[[noreturn]] void Refuse(const std::string& path, const std::string& why,
                         const std::string& hint = "") {
  throw InputError(why, path, hint);
}

Vec3f ReadVec3(NpzReader* file, const std::string& name) {
  const NpzArray array = file->Read(name, ArrayType::kF32, {3});
  const float* values = array.As<float>();
  return {values[0], values[1], values[2]};
}

void CheckReadable(NpzReader* file) {
  RefuseNewerFormat(file, kSplatsVersion);
  if (file->Has("regrade_version") &&
      file->ReadScalar<int32_t>("regrade_version") == kCellsVersion)
    Refuse(file->path(), "its field has cells, which this version does not read",
           "run regrade reconstruct again, with --restart-from reconstruct");
  if (file->Has("basis_type")) {
    const NpzArray type = file->Read("basis_type");
    const bool wide = type.type == ArrayType::kI64, narrow = type.type == ArrayType::kI32;
    if (type.num_elements() != 1 || !(wide || narrow) ||
        (wide ? *type.As<int64_t>() : *type.As<int32_t>()) != kSphericalHarmonics)
      Refuse(file->path(), "its colours are not spherical harmonics",
             "train the checkpoint with svox2's default basis");
  }
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

void ReadSpheres(NpzReader* file, SphereGeometry* spheres, Buffer<float>* color) {
  if (!file->Has("background_links")) return;
  const NpzArray links = file->Read("background_links", ArrayType::kI32, {-1, -1});
  const NpzArray data = file->Read("background_data", ArrayType::kF32, {-1, -1, 4});
  if (links.shape[0] != 2 * links.shape[1] || links.shape[1] > kMaxSphereResolution ||
      data.shape[1] < 1 || data.shape[1] > kMaxLayers)
    Refuse(
        file->path(),
        "a background of " + links.ShapeText() + " texels and " + data.ShapeText() + " values",
        Concat("the map is twice as wide as high, of at most ", kMaxSphereResolution, " and ",
               kMaxLayers, " layers"));
  spheres->layers = static_cast<int>(data.shape[1]);
  spheres->resolution = static_cast<int>(links.shape[1]);
  spheres->links.Resize(links.num_elements());
  for (int64_t i = 0; i < links.num_elements(); ++i)
    spheres->links[i] = std::max(links.As<int32_t>()[i], -1);
  const int64_t texels = data.shape[0] * data.shape[1];
  spheres->density.Resize(texels);
  color->Resize(3 * texels);
  for (int64_t i = 0; i < texels; ++i) {
    const float* const texel = data.As<float>() + 4 * i;
    std::copy_n(texel, 3, color->data() + 3 * i);
    spheres->density[i] = texel[3];
  }
}

// How many rows the values of a geometry have, and why; of voxels the file's values say it.
struct Rows {
  std::optional<int64_t> count = {};
  std::string reason = {};
};

std::vector<uint16_t> Halves(const Buffer<float>& values) {
  std::vector<uint16_t> halves(static_cast<size_t>(values.size()));
  std::ranges::transform(values, halves.begin(), StoredColour);
  return halves;
}

void AddSplats(const Geometry& geometry, MadeArrays* made, NpzWriter* file) {
  const SplatGeometry& splats = geometry.splats;
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

Buffer<float> ReadHalves(NpzReader* file, const std::string& name,
                         const std::vector<int64_t>& shape) {
  const NpzArray array = file->Read(name, ArrayType::kF16, shape);
  Buffer<float> values(array.num_elements());
  for (int64_t i = 0; i < values.size(); ++i) values[i] = ValueAt(array, i);
  return values;
}

Rows ReadSplats(NpzReader* file, Geometry* geometry) {
  SplatGeometry* const splats = &geometry->splats;
  const NpzArray mean = file->Read("regrade_splats_mean", ArrayType::kF32, {-1, 3});
  const int64_t n = mean.shape[0];
  if (n == 0) Refuse(file->path(), "there are no splats");
  splats->mean.Resize(3 * n);
  std::copy_n(mean.As<float>(), 3 * n, splats->mean.data());
  splats->log_scale = ReadHalves(file, "regrade_splats_log_scale", {n, 3});
  splats->quaternion = ReadHalves(file, "regrade_splats_quaternion", {n, 4});
  splats->opacity_logit = ReadHalves(file, "regrade_splats_opacity_logit", {n});
  splats->fit_pixel = file->ReadScalar<float>("regrade_splats_fit_pixel");
  if (!std::isfinite(splats->fit_pixel))
    Refuse(file->path(), "regrade_splats_fit_pixel is not a number");
  return {n, Concat("there are ", n, " splats")};
}

Rows ReadLinks(NpzReader* file, Geometry* geometry) {
  const NpzArray links = file->Read("links", ArrayType::kI32, {-1, -1, -1});
  for (int a = 0; a < 3; ++a) {
    if (links.shape[a] > 4096)
      Refuse(file->path(), "a grid of " + links.ShapeText() + " vertices",
             "at most 4096 along an axis are read");
    geometry->frame.resolution[a] = static_cast<int>(links.shape[a]);
  }
  if (geometry->frame.NumVertices() > INT32_MAX)
    Refuse(file->path(), "a grid of " + links.ShapeText() + " vertices is too large");
  geometry->links.Resize(links.num_elements());
  // svox2 keeps distances to the next voxel below -1.
  for (int64_t i = 0; i < links.num_elements(); ++i)
    geometry->links[i] = std::max(links.As<int32_t>()[i], -1);
  return {};
}

void AddLinks(const Geometry& geometry, MadeArrays*, NpzWriter* file) {
  const Vec3i& n = geometry.frame.resolution;
  file->Add("links", {n.x, n.y, n.z}, geometry.links.data(), NpzPacking::kDeflate);
}

// How a file holds a geometry.
struct Layout {
  int32_t version;
  bool densities;
  Rows (*read)(NpzReader* file, Geometry* geometry);
  void (*add)(const Geometry& geometry, MadeArrays* made, NpzWriter* file);
};
constexpr Layout kVoxels{1, true, ReadLinks, AddLinks},
    kSplats{kSplatsVersion, false, ReadSplats, AddSplats};

const Layout& LayoutOf(const Geometry& geometry) {
  return geometry.splats.on() ? kSplats : kVoxels;
}

const Layout& LayoutOf(NpzReader* file) {
  if (!file->Has("regrade_splats_mean")) return kVoxels;
  if (file->Has("links")) Refuse(file->path(), "a field has voxels or splats, not both");
  return kSplats;
}

void ReadValues(NpzReader* file, const Layout& layout, const Rows& rows, Geometry* geometry,
                Appearance* appearance) {
  const bool joined = file->Has("data");  // old checkpoints: [density, colours] by row
  const NpzArray colours = file->Read(joined ? "data" : "sh_data");
  const int64_t first = joined ? 1 : 0;
  if (colours.shape.size() != 2 ||
      (colours.type != ArrayType::kF16 && colours.type != ArrayType::kF32) ||
      (colours.shape[1] - first) % 3 != 0 || colours.shape[1] > first + 3 * kMaxBasis ||
      !IsBasis(static_cast<int>(colours.shape[1] - first) / 3))
    Refuse(file->path(), std::string("colours are ") + NameOf(colours.type) +
                             colours.ShapeText() + "; 3, 12, 27 or 48 columns are read");
  if (rows.count && colours.shape[0] != *rows.count)
    Refuse(file->path() + ": array '" + (joined ? "data" : "sh_data") + "'",
           Concat(colours.shape[0], " rows, but ", rows.reason));
  const int stored = static_cast<int>((colours.shape[1] - first) / 3);
  appearance->basis =
      file->Has("regrade_basis") ? file->ReadScalar<int32_t>("regrade_basis") : stored;
  const int basis = appearance->basis;
  if (!IsBasis(basis) || basis > stored)
    Refuse(file->path(),
           Concat("regrade_basis is ", basis, " of ", stored, " stored harmonics"));
  appearance->sh = UnpackedColours(colours, first, stored, basis);
  if (!layout.densities) return;
  geometry->density.Resize(colours.shape[0]);
  if (joined) {
    for (int64_t i = 0; i < colours.shape[0]; ++i)
      geometry->density[i] = ValueAt(colours, i * colours.shape[1]);
  } else {
    const NpzArray density = file->Read("density_data", ArrayType::kF32, {colours.shape[0], 1});
    std::copy_n(density.As<float>(), density.num_elements(), geometry->density.data());
  }
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
  const Layout& layout = LayoutOf(geometry);
  MadeArrays made;  // read by the writer in WriteTo
  layout.add(geometry, &made, &file);
  if (layout.densities) file.Add("density_data", {voxels, 1}, geometry.density.data());
  file.AddFilled<uint16_t>(
      "sh_data", {voxels, 3 * StoredBasis(field.appearance)},
      [&field](int64_t first, int64_t count, uint16_t* to) {
        PackColours(field.appearance, first, count, to);
      },
      field.appearance.basis >= kLeastStored ? NpzPacking::kStore : NpzPacking::kDeflate);
  file.AddScalar<int64_t>("basis_type", kSphericalHarmonics);
  file.AddScalar<int32_t>("regrade_version", layout.version);
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

StoredField ReadFieldFile(const std::string& path, uint64_t budget) {
  NpzReader file(path, budget);
  CheckReadable(&file);
  StoredField stored;
  Geometry geometry;
  geometry.frame.radius = ReadVec3(&file, "radius");
  geometry.frame.center = ReadVec3(&file, "center");
  const Layout& layout = LayoutOf(&file);
  const Rows rows = layout.read(&file, &geometry);
  ReadValues(&file, layout, rows, &geometry, &stored.field.appearance);
  ReadSpheres(&file, &geometry.spheres, &stored.field.appearance.sphere_color);
  stored.field.geometry = std::make_shared<const Geometry>(std::move(geometry));
  stored.field.background =
      file.Has("regrade_background") ? ReadVec3(&file, "regrade_background") : Vec3f{1, 1, 1};
  if (file.Has("regrade_near_clip"))
    stored.field.near_clip = file.ReadScalar<float>("regrade_near_clip");
  if (file.Has("regrade_step"))
    stored.field.march.step = file.ReadScalar<float>("regrade_step");
  if (file.Has("regrade_stop"))
    stored.field.march.stop_transmittance = file.ReadScalar<float>("regrade_stop");
  if (file.Has("regrade_field_from_world")) {
    const NpzArray array = file.Read("regrade_field_from_world", ArrayType::kF64, {13});
    const double* placement = array.As<double>();
    stored.field_from_world.scale = placement[0];
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j)
        stored.field_from_world.rotation(i, j) = placement[1 + 3 * i + j];
      stored.field_from_world.translation[i] = placement[10 + i];
    }
    if (!IsSound(stored.field_from_world))
      Refuse(path, "regrade_field_from_world is not a similarity");
  }
  if (file.Has("regrade_ndc")) {
    const NpzArray array = file.Read("regrade_ndc", ArrayType::kF64, {2});
    stored.ndc = {array.As<double>()[0], array.As<double>()[1]};
    if (!(stored.ndc.a > 0 && stored.ndc.a < 1e3 && stored.ndc.b > 0 && stored.ndc.b < 1e3))
      Refuse(path, "regrade_ndc is not the field of view of a picture");
  }
  Validate(stored.field, path.c_str());
  return stored;
}

}  // namespace regrade
