// Fuzz target: the field of a page. Its bytes here are the header as a line of JSON, and for
// each section a line "NAME SIZE" and its bytes, not compressed: mutants pass the checksums.
#include <algorithm>
#include <charconv>
#include <cmath>

#include "kernels/splats/splat_field.h"
#include "pipeline/files/deflate.h"
#include "pipeline/page/field_codec.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/mutate.h"
#include "tests/support/small_splats.h"

namespace regrade::testing {
namespace {

constexpr uint64_t kMost = 1 << 24;

struct Parts {
  std::string header;
  std::vector<std::pair<std::string, std::string>> sections;
};

std::string Joined(const Parts& parts) {
  std::string bytes = parts.header + "\n";
  for (const auto& [name, content] : parts.sections)
    bytes += Concat(name, " ", content.size(), "\n", content);
  return bytes;
}

// Of bytes that are cut, what is whole.
Parts Split(std::string_view bytes) {
  const auto line = [&bytes] {
    const size_t end = std::min(bytes.find('\n'), bytes.size());
    const std::string text(bytes.substr(0, end));
    bytes.remove_prefix(std::min(end + 1, bytes.size()));
    return text;
  };
  Parts parts{line(), {}};
  while (!bytes.empty()) {
    const std::string head = line();
    const size_t space = std::min(head.find(' '), head.size());
    size_t size = 0;
    std::from_chars(head.data() + std::min(space + 1, head.size()), head.data() + head.size(),
                    size);
    size = std::min(size, bytes.size());
    parts.sections.emplace_back(head.substr(0, space), bytes.substr(0, size));
    bytes.remove_prefix(size);
  }
  return parts;
}

std::vector<std::string> FieldSeeds() {
  std::vector<std::string> seeds;
  for (const int basis : {1, 4}) {
    const PageField page = EncodeField(FieldOfSplats(
        CastSplats<float>(RandomSplats(20, basis, 1)), {{}, {}, {1, 1, 1}}, 0, -1));
    Parts parts{DumpJson(page.header, -1), {}};
    for (const PageSection& section : page.sections)
      parts.sections.emplace_back(section.name, Inflate(section.packed, kMost, "seed"));
    seeds.push_back(Joined(parts));
  }
  return seeds;
}

bool ReadField(std::string_view bytes) {
  const Parts parts = Split(bytes);
  return Accepts([&parts] {
    PageField page{ParseJson(parts.header, "page"), {}};
    for (const auto& [name, content] : parts.sections)
      page.sections.push_back({name, Deflate(content)});
    const RadianceField field = DecodeField(page);
    const int64_t records = field.geometry->num_voxels();
    FuzzRequire(field.appearance.sh.size() == records * field.appearance.stride(),
                "each record has its coefficients");
    for (const float mean : field.geometry->splats.mean)
      FuzzRequire(std::isfinite(mean), "means are numbers");
    for (const float value : field.appearance.sh)
      FuzzRequire(std::isfinite(value), "coefficients are numbers");
  });
}

std::string MutateField(std::string bytes, FuzzRandom* random) {
  Parts parts = Split(bytes);
  if (parts.sections.empty() || random->Chance(0.5)) {
    parts.header = MutateJson(std::move(parts.header), random);
    std::erase(parts.header, '\n');
  } else {
    std::string& content = parts.sections[random->Below(parts.sections.size())].second;
    content = MutateBytes(std::move(content), random);
  }
  return Joined(parts);
}

}  // namespace

std::vector<FuzzTarget> PageTargets() {
  return {{"page_field", FieldSeeds, ReadField, MutateField, 800}};
}

}  // namespace regrade::testing
