#include "pipeline/page/field_codec.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/field/pad_sh_basis.h"
#include "kernels/splats/extent.h"
#include "kernels/splats/splat_field.h"
#include "pipeline/page/color_code.h"
#include "pipeline/page/page_sections.h"
#include "pipeline/page/splat_numbers.h"
#include "pipeline/page/value_codec.h"

namespace regrade {
namespace {

// The splats [begin, end) of a page that are packed together.
struct Part {
  std::string prefix;  // of sections' names
  int64_t begin, end;

  size_t count() const { return static_cast<size_t>(end - begin); }
  std::vector<EarlierRecords> Earlier() const { return EarlierSplats(end - begin, 0); }
};

std::array<Part, 2> PartsOf(int64_t count, int64_t coarse) {
  return {Part{"coarse_", 0, coarse}, Part{"", coarse, count}};
}

template <typename T>
std::vector<T> Of(const Part& part, const std::vector<T>& all) {
  return {all.begin() + part.begin, all.begin() + part.end};
}

std::string PackShapes(const RadianceField& field, const std::vector<int64_t>& splat,
                       const std::vector<EarlierRecords>& earlier) {
  const SplatsView<float> splats = SplatsOf(field);
  std::vector<int16_t> numbers(kSplatNumbers * splat.size());
  for (size_t i = 0; i < splat.size(); ++i) {
    const SplatNumbers own = NumbersOfSplat(splats[splat[i]], field.geometry->frame);
    for (size_t k = 0; k < kSplatNumbers; ++k) numbers[k * splat.size() + i] = own[k];
  }
  return PackNumbers(numbers, kSplatNumbers, earlier);
}

void PutSplat(int64_t i, const Splat<float>& splat, SplatGeometry* splats) {
  for (int a = 0; a < 3; ++a) {
    splats->mean[3 * i + a] = splat.mean[a];
    splats->log_scale[3 * i + a] = splat.log_scale[a];
  }
  std::copy_n(splat.quaternion, 4, splats->quaternion.data() + 4 * i);
  splats->opacity_logit[i] = splat.opacity_logit;
}

// [kSplatNumbers, n]; takes no memory for splats that the page has not.
std::vector<int16_t> UnpackShapes(const PageField& page, const Part& part) {
  const size_t size = 2 * kSplatNumbers * part.count();
  const std::string bytes = SectionBytes(page, part.prefix + "shape", size);
  if (bytes.size() != size)
    throw InputError("the page has fewer splats than it says", part.prefix + "shape");
  return UnpackNumbers(bytes, kSplatNumbers, part.Earlier());
}

void PutSplats(const std::vector<int16_t>& numbers, const Part& part, Geometry* geometry) {
  const size_t n = part.count();
  for (size_t i = 0; i < n; ++i) {
    SplatNumbers own;
    for (size_t k = 0; k < kSplatNumbers; ++k) own[k] = numbers[k * n + i];
    PutSplat(part.begin + static_cast<int64_t>(i), SplatOfNumbers(own, geometry->frame),
             &geometry->splats);
  }
}

void UnpackColors(const PageField& page, const Part& part, Appearance* appearance) {
  const ColorCode code = ColorCodeOf(page.header.At("color"));
  const size_t n = part.count();
  const std::string bytes = SectionBytes(page, part.prefix + "color",
                                         2 * static_cast<size_t>(appearance->stride()) * n);
  std::vector<int64_t> splat;
  for (int64_t i = part.begin; i < part.end; ++i) splat.push_back(i);
  PutValues(ColorNumbers(bytes, code, appearance->basis, part.Earlier()), code,
            appearance->basis, splat, appearance->sh.data());
}

}  // namespace

PageField EncodeField(const RadianceField& any, double step) {
  RadianceField field = any;  // a page has harmonics of degree 2 at most
  field.appearance = LimitShBasis(std::move(field.appearance), kCodeHarmonics);
  const SplatOrder order = OrderOfSplats(*field.geometry);
  if (order.splat.empty()) throw InputError("no splat of the field is seen", "field.npz");
  const GridFrame& frame = field.geometry->frame;
  const int basis = field.appearance.basis;
  const SplatOptions options = SplatOptionsOf(field);
  const std::vector<float> light = LightOfSplats(*field.geometry);
  std::vector<float> weight;
  for (const int64_t i : order.splat) weight.push_back(light[static_cast<size_t>(i)]);
  const float* const sh = field.appearance.sh.data();
  const ColorCode code = CodeOfRows({sh, basis, order.splat}, order.earlier, step, weight);
  const auto count = std::ssize(order.splat);
  PageField page;
  page.header =
      JsonValue::Object{{"format", kPageFormat},
                        {"center", ArrayOf(frame.center)},
                        {"radius", ArrayOf(frame.radius)},
                        {"basis", basis},
                        {"background", ArrayOf(field.background)},
                        {"near", double{field.near_clip}},
                        {"color", JsonOf(code)},
                        {"splats", JsonValue::Object{{"count", count},
                                                     {"coarse", order.coarse},
                                                     {"fit_pixel", options.fit_pixel},
                                                     {"near_plane", options.near_plane},
                                                     {"blur", options.blur},
                                                     {"position_step", kPositionStep},
                                                     {"scale_step", kLogScaleStep},
                                                     {"rotation_step", kRotationStep},
                                                     {"opacity_step", 1.0 / kOpacitySteps}}}};
  for (const Part& part : PartsOf(count, order.coarse)) {
    const std::vector<int64_t> splat = Of(part, order.splat);
    const std::vector<EarlierRecords> earlier = part.Earlier();
    AddSection(part.prefix + "shape", PackShapes(field, splat, earlier), &page);
    AddSection(part.prefix + "color",
               PackNumbers(NumbersOf({sh, basis, splat}, code), 3 * basis, earlier), &page);
  }
  return page;
}

RadianceField DecodeField(const PageField& page) {
  const JsonValue& header = page.header;
  if (header.At("format").AsInt() != kPageFormat)
    throw InputError("is of another format", "page");
  const int64_t count = page.count();
  const int64_t coarse = header.At("splats").At("coarse").AsInt();
  if (count < 1 || count > kMaxPageSplats || coarse < 0 || coarse > count)
    throw InputError("the number of splats is not valid", "page");
  auto geometry = std::make_shared<Geometry>();
  ReadBox(header, &geometry->frame);
  RadianceField field;
  field.appearance.basis = BasisOf(header);
  const std::array<Part, 2> parts = PartsOf(count, coarse);
  std::vector<std::vector<int16_t>> shapes;
  for (const Part& part : parts) shapes.push_back(UnpackShapes(page, part));
  SplatGeometry& splats = geometry->splats;
  splats.mean.Resize(3 * count);
  splats.log_scale.Resize(3 * count);
  splats.quaternion.Resize(4 * count);
  splats.opacity_logit.Resize(count);
  splats.fit_pixel = static_cast<float>(header.At("splats").At("fit_pixel").AsDouble());
  field.appearance.sh.Resize(count * field.appearance.stride());
  for (size_t i = 0; i < parts.size(); ++i) {
    PutSplats(shapes[i], parts[i], geometry.get());
    UnpackColors(page, parts[i], &field.appearance);
  }
  CheckColors(field.appearance.sh);
  field.background = Vec3At(header, "background");
  field.near_clip = static_cast<float>(header.At("near").AsDouble());
  field.geometry = std::move(geometry);
  Validate(field, "page");
  return field;
}

PageRecords RecordsInPageOrder(const PageField& page, const Geometry& geometry) {
  SplatOrder order = OrderOfSplats(geometry);
  REGRADE_CHECK_EQ(std::ssize(order.splat), page.count());
  return {std::move(order.splat), std::move(order.earlier)};
}

std::vector<float> LightOfSplats(const Geometry& geometry) {
  const SplatGeometry& splats = geometry.splats;
  std::vector<float> light;
  double sum = 0;
  for (int64_t i = 0; i < geometry.num_voxels(); ++i) {
    std::array<double, 3> log;
    for (int a = 0; a < 3; ++a) log[static_cast<size_t>(a)] = splats.log_scale[3 * i + a];
    std::ranges::sort(log);
    const double area = std::exp(std::clamp(log[1] + log[2], -60.0, 60.0));
    light.push_back(
        static_cast<float>(area * std::exp(LogSigmoid(double{splats.opacity_logit[i]}))));
    sum += double{light.back()};
  }
  const double mean = sum / static_cast<double>(light.size());
  for (float& value : light) value = static_cast<float>(value / mean);
  return light;
}

}  // namespace regrade
