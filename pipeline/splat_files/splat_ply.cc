#include "pipeline/splat_files/splat_ply.h"

#include <array>
#include <bit>
#include <cmath>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/splats/rotate_harmonics.h"
#include "kernels/splats/splat_field.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/splat_files/splat_record.h"
#include "reconstruct/colmap/colmap_model.h"

namespace regrade {
namespace {

std::string Header(int64_t count, int basis, const std::string& comment) {
  std::string header = "ply\nformat binary_little_endian 1.0\ncomment " + comment +
                       "\nelement vertex " + std::to_string(count) + "\n";
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
  const Similarity& field_from_world = stored.field_from_world;
  const Mat3d world_from_field = field_from_world.rotation.Transposed();
  const HarmonicsMatrix turn = RotateHarmonics(world_from_field);
  const std::array<double, 4> turned = QuaternionOf(world_from_field);
  const double log_scale = std::log(field_from_world.scale);
  const size_t basis = static_cast<size_t>(splats.basis);
  std::string bytes = Header(splats.count, splats.basis, comment);
  std::vector<float> row;
  for (int64_t i = 0; i < splats.count; ++i) {
    const Splat<float> splat = splats[i];
    row.clear();
    const Vec3d mean =
        world_from_field *
        ((splat.mean.Cast<double>() - field_from_world.translation) / field_from_world.scale);
    for (int a = 0; a < 3; ++a) row.push_back(static_cast<float>(mean[a]));
    row.insert(row.end(), 3, 0.0f);
    const float* const sh = splats.Coefficients(i);
    for (size_t c = 0; c < 3; ++c) row.push_back(sh[c * basis]);
    for (size_t c = 0; c < 3; ++c)
      for (size_t k = 1; k < basis; ++k) {
        double sum = 0;
        for (size_t j = 1; j < basis; ++j) sum += turn[k][j] * double{sh[c * basis + j]};
        row.push_back(static_cast<float>(sum));
      }
    row.push_back(splat.opacity_logit);
    for (int a = 0; a < 3; ++a)
      row.push_back(static_cast<float>(double{splat.log_scale[a]} - log_scale));
    for (const double q : QuaternionProduct(turned, {splat.quaternion[0], splat.quaternion[1],
                                                     splat.quaternion[2], splat.quaternion[3]}))
      row.push_back(static_cast<float>(q));
    bytes.append(reinterpret_cast<const char*>(row.data()), row.size() * sizeof(float));
  }
  WriteFileAtomically(path, bytes);
}

}  // namespace regrade
