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

constexpr int32_t kCellsVersion = 2, kNewestVersion = 3;
constexpr int64_t kSphericalHarmonics = 1;  // svox2's basis_type

float ValueAt(const NpzArray& array, int64_t i) {
  return array.type == ArrayType::kF16 ? FloatFromHalf(array.As<uint16_t>()[i])
                                       : array.As<float>()[i];
}

// Where the colours of a row of the file go, and which of its columns they are: from `first` on
// `stored` of each channel, of which the first `basis` are kept.
struct ColourColumns {
  int64_t first = 0;
  int stored = 0, basis = 0;

  bool HasDensity() const { return first > 0; }  // in the column before
  void Unpack(const NpzArray& rows, int64_t row, float* sh) const {
    for (int channel = 0; channel < 3; ++channel)
      for (int k = 0; k < basis; ++k)
        sh[channel * basis + k] =
            ValueAt(rows, row * rows.shape[1] + first + channel * stored + k);
  }
};

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
  RefuseNewerFormat(file, kNewestVersion);
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

Rows ReadGeometry(NpzReader* file, Geometry* geometry) {
  if (!file->Has("regrade_splats_mean")) return ReadLinks(file, geometry);
  if (file->Has("links")) Refuse(file->path(), "a field has voxels or splats, not both");
  return ReadSplats(file, geometry);
}

std::string NameOfColours(const NpzReader& file) {
  return file.Has("data") ? "data" : "sh_data";  // old checkpoints: [density, colours] by row
}

ColourColumns ColumnsOf(NpzReader* file, const Rows& rows, int64_t* count) {
  const std::string name = NameOfColours(*file);
  const NpzArray colours = file->Describe(name);
  ColourColumns columns;
  columns.first = name == "data" ? 1 : 0;
  if (colours.shape.size() != 2 ||
      (colours.type != ArrayType::kF16 && colours.type != ArrayType::kF32) ||
      (colours.shape[1] - columns.first) % 3 != 0 ||
      colours.shape[1] > columns.first + 3 * kMaxBasis ||
      !IsBasis(static_cast<int>(colours.shape[1] - columns.first) / 3))
    Refuse(file->path(), std::string("colours are ") + NameOf(colours.type) +
                             colours.ShapeText() + "; 3, 12, 27 or 48 columns are read");
  *count = colours.shape[0];
  if (rows.count && *count != *rows.count)
    Refuse(file->path() + ": array '" + name + "'", Concat(*count, " rows, but ", rows.reason));
  columns.stored = static_cast<int>((colours.shape[1] - columns.first) / 3);
  columns.basis =
      file->Has("regrade_basis") ? file->ReadScalar<int32_t>("regrade_basis") : columns.stored;
  if (!IsBasis(columns.basis) || columns.basis > columns.stored)
    Refuse(file->path(), Concat("regrade_basis is ", columns.basis, " of ", columns.stored,
                                " stored harmonics"));
  return columns;
}

// `density`: of the same rows; null where they are apart.
void ReadColours(NpzReader* file, const ColourColumns& columns, const KeptRecords& records,
                 Appearance* appearance, Buffer<float>* density) {
  appearance->basis = columns.basis;
  const int64_t each = appearance->stride();
  const int64_t most = records.all ? records.of : std::ssize(records.kept);
  int64_t begin = 0;  // what is read of `most`
  file->ReadRows(NameOfColours(*file), [&](int64_t first, const NpzArray& rows) {
    if (first == 0) {  // within the budget
      appearance->sh.Resize(each * most);
      if (density != nullptr) density->Resize(most);
    }
    const int64_t next = first + rows.shape[0];
    const int64_t end =
        records.all ? next
                    : std::ranges::lower_bound(records.kept, next) - records.kept.begin();
#pragma omp parallel for schedule(static)
    for (int64_t i = begin; i < end; ++i) {
      const int64_t row = (records.all ? i : records.kept[static_cast<size_t>(i)]) - first;
      columns.Unpack(rows, row, appearance->sh.data() + each * i);
      if (density != nullptr) (*density)[i] = ValueAt(rows, row * rows.shape[1]);
    }
    begin = end;
  });
}

void ReadDensities(NpzReader* file, int64_t count, Buffer<float>* densities) {
  const NpzArray density = file->Read("density_data", ArrayType::kF32, {count, 1});
  densities->Resize(count);
  std::copy_n(density.As<float>(), count, densities->data());
}

// What a filter keeps of a geometry of splats.
void Keep(const std::vector<uint8_t>& which, SplatGeometry* splats, KeptRecords* records) {
  REGRADE_CHECK(std::ssize(which) == records->of);
  records->all = false;
  for (int64_t i = 0; i < records->of; ++i)
    if (which[static_cast<size_t>(i)] != 0) records->kept.push_back(i);
  if (records->kept.empty()) records->kept.push_back(0);  // a field has splats
  const auto pick = [&](int each, Buffer<float>* values) {
    Buffer<float> picked(each * std::ssize(records->kept));
    float* to = picked.data();
    for (const int64_t i : records->kept) {
      std::copy_n(values->data() + each * i, each, to);
      to += each;
    }
    *values = std::move(picked);
  };
  pick(3, &splats->mean);
  pick(3, &splats->log_scale);
  pick(4, &splats->quaternion);
  pick(1, &splats->opacity_logit);
}

void ReadPlacement(NpzReader* file, StoredField* stored) {
  const std::string& path = file->path();
  if (file->Has("regrade_background"))
    stored->field.background = ReadVec3(file, "regrade_background");
  if (file->Has("regrade_near_clip"))
    stored->field.near_clip = file->ReadScalar<float>("regrade_near_clip");
  if (file->Has("regrade_step"))
    stored->field.march.step = file->ReadScalar<float>("regrade_step");
  if (file->Has("regrade_stop"))
    stored->field.march.stop_transmittance = file->ReadScalar<float>("regrade_stop");
  if (file->Has("regrade_field_from_world")) {
    const NpzArray array = file->Read("regrade_field_from_world", ArrayType::kF64, {13});
    const double* placement = array.As<double>();
    stored->field_from_world.scale = placement[0];
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j)
        stored->field_from_world.rotation(i, j) = placement[1 + 3 * i + j];
      stored->field_from_world.translation[i] = placement[10 + i];
    }
    if (!IsSound(stored->field_from_world))
      Refuse(path, "regrade_field_from_world is not a similarity");
  }
  if (file->Has("regrade_ndc")) {
    const NpzArray array = file->Read("regrade_ndc", ArrayType::kF64, {2});
    stored->ndc = {array.As<double>()[0], array.As<double>()[1]};
    if (!(stored->ndc.a > 0 && stored->ndc.a < 1e3 && stored->ndc.b > 0 && stored->ndc.b < 1e3))
      Refuse(path, "regrade_ndc is not the field of view of a picture");
  }
}

// `keep` may be empty; `colors` is false where splats are to have none.
StoredField ReadField(const std::string& path, uint64_t budget, const SplatFilter& keep,
                      bool colors) {
  NpzReader file(path, budget);
  CheckReadable(&file);
  StoredField stored;
  RadianceField& field = stored.field;
  field.background = {1, 1, 1};  // svox2's
  const auto geometry = std::make_shared<Geometry>();
  field.geometry = geometry;
  geometry->frame.radius = ReadVec3(&file, "radius");
  geometry->frame.center = ReadVec3(&file, "center");
  const Rows rows = ReadGeometry(&file, geometry.get());
  const bool splats = geometry->splats.on();
  ReadPlacement(&file, &stored);
  const ColourColumns columns = ColumnsOf(&file, rows, &stored.records.of);
  if (splats && keep) {
    Keep(keep(field), &geometry->splats, &stored.records);
  }
  const bool apart = !splats && !columns.HasDensity();
  if (apart) ReadDensities(&file, stored.records.of, &geometry->density);
  if (splats && !colors) {
    field.appearance.basis = 1;
    field.appearance.sh.Resize(3 * stored.records.of);
  } else {
    ReadColours(&file, columns, stored.records, &field.appearance,
                splats || apart ? nullptr : &geometry->density);
  }
  ReadSpheres(&file, &geometry->spheres, &field.appearance.sphere_color);
  Validate(field, path.c_str());
  return stored;
}

}  // namespace

StoredField ReadFieldFile(const std::string& path, uint64_t budget) {
  return ReadField(path, budget, {}, true);
}

int64_t CountSplats(const std::string& path) {
  NpzReader file(path, kMostField);
  if (!file.Has("regrade_splats_mean")) return 0;
  const std::vector<int64_t> shape = file.Describe("regrade_splats_mean").shape;
  return shape.empty() ? 0 : shape[0];
}

StoredField ReadPartOfField(const std::string& path, const SplatFilter& keep) {
  return ReadField(path, kMostField, keep, true);
}

StoredField ReadFieldGeometry(const std::string& path) {
  return ReadField(path, kMostField, {}, false);
}

}  // namespace regrade
