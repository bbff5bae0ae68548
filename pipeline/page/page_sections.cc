#include "pipeline/page/page_sections.h"

#include <cmath>
#include <cstdlib>

#include "kernels/base/error.h"
#include "pipeline/files/deflate.h"
#include "pipeline/page/value_codec.h"

namespace regrade {
namespace {

// The mean of a coefficient over a record's earlier neighbours, 0 without any.
float EarlierMean(const ColorRows& rows, const EarlierRecords& earlier, int coefficient) {
  float sum = 0, n = 0;
  for (const int32_t other : earlier)
    if (other >= 0) sum += rows[static_cast<size_t>(other)][coefficient], ++n;
  return n > 0 ? sum / n : 0;
}

}  // namespace

void AddSection(const std::string& name, const std::string& bytes, PageField* page) {
  page->sections.push_back({name, Deflate(bytes)});
}

std::string SectionBytes(const PageField& page, const std::string& name, uint64_t max_bytes) {
  for (const PageSection& section : page.sections)
    if (section.name == name) return Inflate(section.packed, max_bytes, name);
  throw InputError("is missing", name);
}

JsonValue::Array ArrayOf(const Vec3f& v) { return {double{v.x}, double{v.y}, double{v.z}}; }

std::vector<double> NumbersAt(const JsonValue& object, const char* key, size_t count) {
  std::vector<double> numbers;
  for (const JsonValue& value : object.At(key).AsArray()) numbers.push_back(value.AsDouble());
  if (numbers.size() != count)
    throw InputError(Concat(numbers.size(), " numbers, ", count, " expected"), key);
  return numbers;
}

Vec3f Vec3At(const JsonValue& object, const char* key) {
  const std::vector<double> n = NumbersAt(object, key, 3);
  return Vec3d{n[0], n[1], n[2]}.Cast<float>();
}

void ReadBox(const JsonValue& header, GridFrame* frame) {
  frame->center = Vec3At(header, "center");
  frame->radius = Vec3At(header, "radius");
  for (int a = 0; a < 3; ++a)
    if (!(frame->radius[a] > 0) || !std::isfinite(frame->radius[a]))
      throw InputError("the box is not valid", "page");
}

int BasisOf(const JsonValue& header) {
  const int64_t basis = header.At("basis").AsInt();
  if (basis != 1 && basis != 4 && basis != 9)
    throw InputError("the basis is not valid", "page");
  return static_cast<int>(basis);
}

ColorCode CodeOfRows(const ColorRows& rows, const std::vector<EarlierRecords>& earlier,
                     double step, const std::vector<float>& weight) {
  const int channels = 3 * rows.basis;
  std::vector<float> values, differences, weights;
  for (const size_t i : FittedRows(rows.size())) {
    values.insert(values.end(), rows[i], rows[i] + channels);
    for (int c = 0; c < channels; ++c)
      differences.push_back(rows[i][c] - EarlierMean(rows, earlier[i], c));
    if (!weight.empty()) weights.push_back(weight[i]);
  }
  return FitColorCode(differences, values, rows.basis, step, weights);
}

std::vector<int16_t> ColorNumbers(std::string_view bytes, const ColorCode& code, int basis,
                                  const std::vector<EarlierRecords>& earlier) {
  const size_t n = earlier.size();
  std::vector<int16_t> numbers = UnpackNumbers(bytes, 3 * basis, earlier);
  for (int c = 0; c < 3 * basis; ++c) {
    const int limit = code.limit(c / basis * kCodeHarmonics + c % basis);
    for (size_t i = 0; i < n; ++i)
      if (std::abs(numbers[static_cast<size_t>(c) * n + i]) > limit)
        throw InputError("a number has more bits than it may have", "color");
  }
  return numbers;
}

void CheckColors(const Buffer<float>& sh) {
  for (const float value : sh)
    if (!std::isfinite(value)) throw InputError("a coefficient is not finite", "color");
}

}  // namespace regrade
