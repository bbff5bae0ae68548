#include "pipeline/page/voxel_codec.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/base/half.h"
#include "pipeline/page/color_code.h"
#include "pipeline/page/page_order.h"
#include "pipeline/page/page_sections.h"
#include "pipeline/page/sphere_order.h"
#include "pipeline/page/value_codec.h"

namespace regrade {
namespace {

constexpr char kWhere[] = "page";
constexpr uint64_t kMaxPlaces = uint64_t{1} << 29;  // bytes
constexpr double kSphereStep = 0.02;  // of background colours, 3 coefficients a texel

template <typename T>
JsonValue::Array ArrayOf(const std::vector<T>& values) {
  return {values.begin(), values.end()};
}

// The largest of a voxel's edges, world units: lengths in a page are in units of it.
double VoxelWidth(const GridFrame& frame) {
  const Vec3f scale = frame.Scale();
  return 1 / double{std::min({scale.x, scale.y, scale.z})};
}

void EncodeVoxelColors(const ColorRows& rows, const std::vector<EarlierRecords>& earlier,
                       double step, PageField* page) {
  const ColorCode code = CodeOfRows(rows, earlier, step, {});
  const std::string bytes = PackNumbers(NumbersOf(rows, code), 3 * rows.basis, earlier);
  AddSection("color", bytes, page);  // the numbers are gone
  page->header["color"] = JsonOf(code);
}

// Sets the coefficients [V, 3, basis] of the voxels `voxel`.
void DecodeVoxelColors(const PageField& page, int basis, const std::vector<int64_t>& voxel,
                       const std::vector<EarlierRecords>& earlier, Buffer<float>* sh) {
  const ColorCode code = ColorCodeOf(page.header.At("color"));
  const std::string bytes =
      SectionBytes(page, "color", 6 * static_cast<size_t>(basis) * earlier.size());
  PutValues(ColorNumbers(bytes, code, basis, earlier), code, basis, voxel, sh->data());
  CheckColors(*sh);
}

// The colours of background spheres.
void EncodeColors(const std::vector<float>& values, int channels,
                  const std::vector<EarlierRecords>& earlier, double step, const char* name,
                  PageField* page) {
  const ValueTransform transform =
      DecorrelatingTransform(Differences(values, channels, earlier), channels);
  const std::vector<int16_t> numbers = NumbersOf(values, transform, step);
  AddSection(name, PackNumbers(numbers, channels, earlier), page);
  page->header[name] = JsonValue::Object{
      {"step", step},
      {"matrix", ArrayOf(transform.matrix)},
      {"scale", ArrayOf(CodeScales(ValuesOf(numbers, transform, step), channels))}};
}

// [V, channels], of 8 bits.
std::vector<float> DecodeColors(const PageField& page, int channels,
                                const std::vector<EarlierRecords>& earlier, const char* name) {
  const JsonValue& header = page.header.At(name);
  const size_t n = static_cast<size_t>(channels);
  const ValueTransform transform{channels, NumbersAt(header, "matrix", n * n)};
  const std::vector<double> scale = NumbersAt(header, "scale", n);
  for (const double s : scale)
    if (!(s > 0 && s < 1e30)) throw InputError("a scale is not valid", name);
  const std::string bytes = SectionBytes(page, name, 2 * n * earlier.size());
  std::vector<float> values = ValuesOf(UnpackNumbers(bytes, channels, earlier), transform,
                                       header.At("step").AsDouble());
  for (size_t i = 0; i < values.size(); ++i) {
    const double s = scale[i % n];
    if (!std::isfinite(values[i])) throw InputError("a coefficient is not finite", name);
    values[i] = static_cast<float>((CodeOf(values[i], s) - 128) * s);
  }
  return values;
}

float AsHalf(double density, double unit) {
  const auto scaled =
      static_cast<float>(std::clamp(density * unit, -double{kMaxHalf}, double{kMaxHalf}));
  return static_cast<float>(FloatFromHalf(HalfFromFloat(scaled)) / unit);
}

void EncodeSpheres(const RadianceField& field, PageField* page) {
  const SphereGeometry& spheres = field.geometry->spheres;
  if (!spheres.on()) return;
  const std::string mask = MaskOfSpheres(spheres);
  const SphereOrder order = OrderOfSpheres(mask, spheres.resolution, spheres.layers);
  std::vector<int16_t> density;
  std::vector<float> color;
  for (const int32_t place : order.place)
    for (int i = 0; i < spheres.layers; ++i) {
      const int64_t texel = int64_t{spheres.links[place]} * spheres.layers + i;
      density.push_back(DensityNumber(spheres.density[texel], 1.0 / spheres.layers));
      color.insert(color.end(), field.appearance.sphere_color.data() + 3 * texel,
                   field.appearance.sphere_color.data() + 3 * texel + 3);
    }
  page->header["spheres"] =
      JsonValue::Object{{"layers", spheres.layers}, {"resolution", spheres.resolution}};
  AddSection("sphere_mask", mask, page);
  AddSection("sphere_density", PackNumbers(density, 1, order.earlier), page);
  EncodeColors(color, 3, order.earlier, kSphereStep, "sphere_color", page);
}

void DecodeSpheres(const PageField& page, Geometry* geometry, Buffer<float>* color) {
  const JsonValue* const header = page.header.Find("spheres");
  if (header == nullptr || header->IsNull()) return;
  SphereGeometry& spheres = geometry->spheres;
  const int64_t layers = header->At("layers").AsInt();
  const int64_t resolution = header->At("resolution").AsInt();
  if (layers < 1 || layers > kMaxLayers || resolution < 2 || resolution > kMaxSphereResolution)
    throw InputError("the background is not valid", kWhere);
  spheres.layers = static_cast<int>(layers);
  spheres.resolution = static_cast<int>(resolution);
  const std::string mask = SectionBytes(
      page, "sphere_mask", static_cast<uint64_t>(2 * resolution * resolution / 8 + 1));
  const SphereOrder order = OrderOfSpheres(mask, spheres.resolution, spheres.layers);
  spheres.links.Resize(2 * resolution * resolution);
  std::fill(spheres.links.begin(), spheres.links.end(), -1);
  for (size_t i = 0; i < order.place.size(); ++i)
    spheres.links[order.place[i]] = static_cast<int32_t>(i);
  const std::vector<int16_t> density = UnpackNumbers(
      SectionBytes(page, "sphere_density", 2 * order.earlier.size()), 1, order.earlier);
  const std::vector<float> values = DecodeColors(page, 3, order.earlier, "sphere_color");
  spheres.density.Resize(static_cast<int64_t>(density.size()));
  for (size_t i = 0; i < density.size(); ++i)
    spheres.density[static_cast<int64_t>(i)] =
        AsHalf(DensityOfNumber(density[i], 1.0 / spheres.layers), 1);
  color->Resize(static_cast<int64_t>(values.size()));
  std::copy(values.begin(), values.end(), color->begin());
}

// Where the voxels of the page are in the field: [V].
std::vector<int64_t> VoxelsOf(const Geometry& geometry, const PageOrder& order) {
  std::vector<int64_t> voxel;
  for (const Vec3i& place : order.place)
    voxel.push_back(geometry.links[geometry.frame.Vertex(place.x, place.y, place.z)]);
  return voxel;
}

void MakeLinks(const PageOrder& order, Geometry* geometry) {
  geometry->links.Resize(geometry->frame.NumVertices());
  std::fill(geometry->links.begin(), geometry->links.end(), -1);
  for (size_t i = 0; i < order.place.size(); ++i) {
    const Vec3i& at = order.place[i];
    geometry->links[geometry->frame.Vertex(at.x, at.y, at.z)] = static_cast<int32_t>(i);
  }
}

}  // namespace

PageRecords VoxelsInPageOrder(const PageField& page, const Geometry& geometry) {
  PageOrder order =
      OrderOfMask(SectionBytes(page, "mask", kMaxPlaces), geometry.frame.resolution);
  std::vector<int64_t> voxel = VoxelsOf(geometry, order);
  return {std::move(voxel), std::move(order.earlier)};
}

PageField EncodeVoxels(const RadianceField& field, double step) {
  const Geometry& geometry = *field.geometry;
  const GridFrame& frame = geometry.frame;
  PageField page;
  const std::string places = MaskOfGrid(geometry);
  const PageOrder order = OrderOfMask(places, frame.resolution);
  const std::vector<int64_t> voxel = VoxelsOf(geometry, order);
  std::vector<int16_t> density;
  const double unit = VoxelWidth(frame);
  for (const int64_t i : voxel) density.push_back(DensityNumber(geometry.density[i], unit));
  page.header = JsonValue::Object{
      {"format", kPageFormat},
      {"voxels", static_cast<int64_t>(voxel.size())},
      {"resolution",
       JsonValue::Array{frame.resolution.x, frame.resolution.y, frame.resolution.z}},
      {"center", ArrayOf(frame.center)},
      {"radius", ArrayOf(frame.radius)},
      {"basis", field.appearance.basis},
      {"background", ArrayOf(field.background)},
      {"near", double{field.near_clip}},
      {"step", double{field.march.step}}};
  AddSection("mask", places, &page);
  AddSection("density", PackNumbers(density, 1, order.earlier), &page);
  EncodeVoxelColors({field.appearance.sh.data(), field.appearance.basis, voxel}, order.earlier,
                    step, &page);
  EncodeSpheres(field, &page);
  return page;
}

RadianceField DecodeVoxels(const PageField& page) {
  const JsonValue& header = page.header;
  auto geometry = std::make_shared<Geometry>();
  GridFrame& frame = geometry->frame;
  const std::vector<double> resolution = NumbersAt(header, "resolution", 3);
  for (int a = 0; a < 3; ++a) {
    if (!(resolution[a] >= 2 && resolution[a] <= kMaxPageSide))
      throw InputError("the resolution is not valid", kWhere);
    frame.resolution[a] = static_cast<int>(resolution[a]);
  }
  ReadBox(header, &frame);
  const PageOrder order = OrderOfMask(SectionBytes(page, "mask", kMaxPlaces), frame.resolution);
  if (order.place.empty()) throw InputError("there are no voxels", kWhere);
  RadianceField field;
  field.appearance.basis = BasisOf(header);
  const int channels = field.appearance.stride();
  const std::vector<int16_t> density =
      UnpackNumbers(SectionBytes(page, "density", 2 * order.place.size()), 1, order.earlier);
  MakeLinks(order, geometry.get());
  const double unit = VoxelWidth(frame);
  const auto n = static_cast<int64_t>(order.place.size());
  geometry->density.Resize(n);
  field.appearance.sh.Resize(n * channels);
  const std::vector<int64_t> voxel = VoxelsOf(*geometry, order);
  for (size_t i = 0; i < voxel.size(); ++i)
    geometry->density[voxel[i]] = AsHalf(DensityOfNumber(density[i], unit), unit);
  DecodeVoxelColors(page, field.appearance.basis, voxel, order.earlier, &field.appearance.sh);
  DecodeSpheres(page, geometry.get(), &field.appearance.sphere_color);
  field.background = Vec3At(header, "background");
  field.near_clip = static_cast<float>(header.At("near").AsDouble());
  field.march.step = static_cast<float>(header.At("step").AsDouble());
  field.geometry = std::move(geometry);
  return field;
}

std::vector<float> OpacityOfVoxels(const Geometry& geometry) {
  std::vector<float> opacity;
  const double width = VoxelWidth(geometry.frame);
  for (const float density : geometry.density)
    opacity.push_back(
        static_cast<float>(1.01 - std::exp(-std::max(0.0, double{density}) * width)));
  return opacity;
}

}  // namespace regrade
