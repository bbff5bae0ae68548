#include "stylize/field/apply_network.h"

#include <algorithm>

#include "kernels/base/error.h"

namespace regrade {

Appearance ApplyNetwork(const LipschitzNetwork& network, const RadianceField& field,
                        const ProgressFunction& progress) {
  if (network.row().basis != RowOf(field.appearance.basis).basis)
    throw InputError(Concat("it knows ", network.row().basis,
                            " harmonics a channel, the field has ", field.appearance.basis),
                     "network.npz", "run regrade stylize again");
  return ApplyForward([&](const float* features, int64_t n,
                          float* output) { network.Forward(features, n, output); },
                      network.data().position_scale, field, progress);
}

Appearance ApplyForward(const ForwardPass& forward, float position_scale,
                        const RadianceField& field, const ProgressFunction& progress) {
  constexpr int64_t kChunk = 1 << 17;  // voxels; 32 MB of features and results
  const std::vector<int32_t> vertex = VertexOfVoxel(*field.geometry);
  const int64_t n = field.geometry->num_voxels();
  const NetworkRow shape = RowOf(field.appearance.basis);
  const int basis = shape.basis;
  Appearance styled;
  styled.basis = basis;
  styled.sh.Resize(n * styled.stride());
  styled.sphere_color.Resize(field.appearance.sphere_color.size());
  const SphereGeometry& spheres = field.geometry->spheres;
  const std::vector<int32_t> place = PlaceOfColumn(spheres);
  const int64_t all = n + spheres.num_texels();
  Buffer<float> features(std::min(all, kChunk) * shape.stride()), output(features.size());
  for (int64_t begin = 0; begin < all; begin += kChunk) {
    const int64_t count = std::min(kChunk, all - begin);
#pragma omp parallel for schedule(static)
    for (int64_t i = 0; i < count; ++i) {
      float* const row = features.data() + i * shape.stride();
      const int64_t point = begin + i, texel = point - n;
      if (texel < 0)
        FillFeatures(field, position_scale, point, vertex[point], row);
      else
        FillTexelFeatures(field, position_scale, texel, place[texel / spheres.layers], row);
    }
    forward(features.data(), count, output.data());
#pragma omp parallel for schedule(static)
    for (int64_t i = 0; i < count; ++i) {
      const int64_t point = begin + i, texel = point - n;
      for (int c = 0; c < 3; ++c) {
        const float* const row = output.data() + i * shape.stride() + c * shape.basis;
        if (texel < 0)
          std::copy_n(row, basis, styled.sh.data() + (point * 3 + c) * basis);
        else
          styled.sphere_color[3 * texel + c] = row[0];
      }
    }
    ReportOrThrow(progress, begin + count, all);
  }
  return styled;
}

}  // namespace regrade
