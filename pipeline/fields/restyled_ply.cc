#include "pipeline/fields/restyled_ply.h"

#include <algorithm>
#include <cstdint>
#include <string_view>
#include <utility>
#include <vector>

#include "kernels/base/error.h"
#include "pipeline/fields/compressed_ply.h"
#include "pipeline/fields/gaussian_ply.h"
#include "pipeline/fields/ply_header.h"
#include "pipeline/fields/ply_rows.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/text.h"

namespace regrade {
namespace {

// Coefficient k of a channel, and the property that has it.
struct Coefficient {
  size_t property, channel, k;
};

std::vector<Coefficient> InOrderOfTheFile(const GaussianLayout& layout) {
  std::vector<Coefficient> order;
  const size_t basis = static_cast<size_t>(layout.basis);
  for (size_t i = 0; i < 3 * basis; ++i)
    order.push_back({layout.property[kFirstHarmonic + i], i / basis, i % basis});
  std::ranges::sort(order, {}, &Coefficient::property);
  return order;
}

}  // namespace

bool IsGaussianPly(const std::filesystem::path& path) {
  const std::string bytes = ReadWholeFile(path.string(), UINT64_MAX);
  if (!LooksLikePly(bytes)) return false;
  const PlyHeader header = ParsePlyHeader(bytes, path.string());
  if (IsCompressedPly(header)) return false;
  const GaussianLayout layout = FindGaussians(header, path.string());
  const PlyElement& element = header.elements[layout.vertex];
  return std::ranges::none_of(InOrderOfTheFile(layout), [&](const Coefficient& c) {
    return IsInteger(element.properties[c.property].type);
  });
}

void WriteRestyled(const std::filesystem::path& path_in, const std::filesystem::path& path_out,
                   const NewColors& colors, const std::string& comment) {
  const std::string where = path_in.string();
  const std::string bytes = ReadWholeFile(where, UINT64_MAX);
  const PlyHeader header = LooksLikePly(bytes) ? ParsePlyHeader(bytes, where) : PlyHeader{};
  if (!LooksLikePly(bytes) || IsCompressedPly(header))
    throw UsageError("only a PLY that is not compressed can be written back", where,
                     "convert it first (`splat-transform IN OUT.ply`)");
  const GaussianLayout layout = FindGaussians(header, where);
  const PlyElement& element = header.elements[layout.vertex];
  REGRADE_CHECK(colors.basis >= 1 && colors.basis <= kMaxBasis);
  const std::vector<Coefficient> order = InOrderOfTheFile(layout);
  for (const Coefficient& c : order)
    if (IsInteger(element.properties[c.property].type))
      throw UsageError("its colours are integers, which cannot take restyled ones", where,
                       "write it with floats (`splat-transform`)");

  AtomicFile file(path_out.string(), bytes.size());
  size_t copied = 0;
  // Replaces the bytes from `begin` to `end` of the file.
  const auto replace = [&](size_t begin, size_t end, const std::string& by) {
    file.Write(bytes.data() + copied, begin - copied);
    file.Write(by.data(), by.size());
    copied = end;
  };
  replace(header.after_format, header.after_format,
          "comment " + Printable(comment) + header.line_end);
  PlyRows rows(bytes, header, layout.vertex, where);
  int64_t usable = 0;
  for (uint64_t i = 0; i < element.count; ++i) {
    rows.Next();
    ColoredSplat record = RecordOf(rows, layout);
    if (!CleanRecord(layout.basis, &record)) continue;
    if (usable++ >= colors.count) break;
    float row[3 * kMaxBasis];
    if (!colors.of(usable - 1, row)) continue;
    for (const Coefficient& c : order) {
      const size_t width = static_cast<size_t>(colors.basis);
      const float value = c.k < width ? row[c.channel * width + c.k] : 0.0f;
      const std::string_view cell = rows.Cell(c.property);
      const size_t begin = static_cast<size_t>(cell.data() - bytes.data());
      replace(begin, begin + cell.size(),
              PlyCell(value, element.properties[c.property].type, header.encoding));
    }
  }
  if (usable != colors.count)
    throw InputError(Concat("it no longer has the ", colors.count, " splats that were read"),
                     where, "has the file been changed? run the same command again");
  file.Write(bytes.data() + copied, bytes.size() - copied);
  file.Commit();
}

}  // namespace regrade
