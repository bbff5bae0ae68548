#include "evaluate/flow_file.h"

#include <bit>
#include <cmath>
#include <fstream>
#include <limits>

#include "kernels/base/error.h"

namespace regrade {
namespace {

static_assert(std::endian::native == std::endian::little, "the .flo format is little-endian");

constexpr float kMark = 202021.25f;
constexpr float kUnknownAbove = 1e9f;
constexpr float kUnknown = 1e10f;
constexpr int32_t kMaxSide = 1 << 15;

struct Header {
  float mark;
  int32_t width, height;
};
static_assert(sizeof(Header) == 12);

[[noreturn]] void Refuse(const std::string& what, const std::string& path) {
  throw InputError(what, path, "flow files are Middlebury .flo, uncompressed");
}

}  // namespace

FlowField ReadFlowFile(const std::string& path, int64_t* unknown_pixels) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (!file) Refuse("cannot open the flow file", path);
  const int64_t size = static_cast<int64_t>(file.tellg());
  file.seekg(0);
  Header header;
  if (size < static_cast<int64_t>(sizeof(header)) ||
      !file.read(reinterpret_cast<char*>(&header), sizeof(header)))
    Refuse("the flow file ends within its header", path);
  if (header.mark != kMark) Refuse("this is not a .flo file (its mark is not 202021.25)", path);
  if (header.width < 1 || header.width > kMaxSide || header.height < 1 ||
      header.height > kMaxSide)
    Refuse(Concat("the flow file claims ", header.width, " x ", header.height, " px"), path);
  const int64_t guaranteed = static_cast<int64_t>(sizeof(header)) +
                             static_cast<int64_t>(header.width) * header.height * 8;
  if (size != guaranteed)
    Refuse(Concat("the flow file has ", size, " bytes, its header specifies ", guaranteed),
           path);
  FlowField flow(header.width, header.height);
  if (!file.read(reinterpret_cast<char*>(flow.uv.data()), guaranteed - sizeof(header)))
    Refuse("reading the flow file failed", path);
  int64_t unknown = 0;
  for (size_t i = 0; i < flow.uv.size(); i += 2) {
    // The comparisons are false for NaN, which counts as unknown.
    const bool known =
        std::abs(flow.uv[i]) <= kUnknownAbove && std::abs(flow.uv[i + 1]) <= kUnknownAbove;
    if (known) continue;
    flow.uv[i] = flow.uv[i + 1] = std::numeric_limits<float>::quiet_NaN();
    ++unknown;
  }
  if (unknown_pixels != nullptr) *unknown_pixels = unknown;
  return flow;
}

void WriteFlowFile(const std::string& path, const FlowField& flow) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  const Header header{kMark, flow.width, flow.height};
  file.write(reinterpret_cast<const char*>(&header), sizeof(header));
  std::vector<float> row(static_cast<size_t>(flow.width) * 2);
  for (int y = 0; y < flow.height; ++y) {
    for (int x = 0; x < flow.width; ++x) {
      const float* f = flow.at(x, y);
      const bool known = std::isfinite(f[0]) && std::isfinite(f[1]);
      row[2 * x] = known ? f[0] : kUnknown;
      row[2 * x + 1] = known ? f[1] : kUnknown;
    }
    file.write(reinterpret_cast<const char*>(row.data()), sizeof(float) * row.size());
  }
  file.close();
  if (!file)
    throw ResourceError("cannot write the flow file", path,
                        "check the disk's free space and permissions");
}

std::string FlowFileName(int from, int to) { return Format("%05d_%05d.flo", from, to); }

}  // namespace regrade
