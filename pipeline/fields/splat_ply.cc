#include "pipeline/fields/splat_ply.h"

#include <bit>
#include <vector>

#include "kernels/splats/splat_field.h"
#include "pipeline/fields/gaussian_ply.h"
#include "pipeline/fields/placed_splats.h"
#include "pipeline/files/atomic_file.h"

namespace regrade {
namespace {

std::string Header(int64_t count, int basis, const std::string& comments) {
  std::string header = "ply\nformat binary_little_endian 1.0\n" + comments + "element vertex " +
                       std::to_string(count) + "\n";
  const auto add = [&header](const std::string& name) {
    header += "property float " + name + "\n";
  };
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"})
    add(name);
  for (int k = 0; k < 3 * (basis - 1); ++k) add("f_rest_" + std::to_string(k));
  add("opacity");
  for (int a = 0; a < 3; ++a) add("scale_" + std::to_string(a));
  for (int a = 0; a < 4; ++a) add("rot_" + std::to_string(a));
  return header + "end_header\n";
}

}  // namespace

void WriteSplatPly(const std::string& path, const StoredField& stored,
                   const std::string& comment) {
  static_assert(std::endian::native == std::endian::little);
  const SplatsView<float> splats = SplatsOf(stored.field);
  const SplatMove to_world = ToWorld(stored);
  const size_t basis = static_cast<size_t>(splats.basis);
  const std::string header =
      Header(splats.count, splats.basis,
             CommentLines(comment, stored.field.geometry->splats.fit_pixel == 0));
  AtomicFile file(path, header.size() + static_cast<size_t>(splats.count) * sizeof(float) *
                                            (14 + 3 * basis));
  file.Write(header.data(), header.size());
  std::vector<float> row;
  for (int64_t i = 0; i < splats.count; ++i) {
    ColoredSplat record = SplatAt(splats, i);
    to_world.Apply(splats.basis, &record);
    const Splat<float>& splat = record.splat;
    const float* const sh = record.sh;
    row.assign({splat.mean.x, splat.mean.y, splat.mean.z, 0, 0, 0});
    for (size_t c = 0; c < 3; ++c) row.push_back(sh[c * basis]);
    for (size_t c = 0; c < 3; ++c)
      row.insert(row.end(), sh + c * basis + 1, sh + (c + 1) * basis);
    row.push_back(splat.opacity_logit);
    for (int a = 0; a < 3; ++a) row.push_back(splat.log_scale[a]);
    row.insert(row.end(), splat.quaternion, splat.quaternion + 4);
    file.Write(row.data(), row.size() * sizeof(float));
  }
  file.Commit();
}

}  // namespace regrade
