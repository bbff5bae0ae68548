#include "stylize/apply_network.h"

#include <algorithm>

#include "kernels/base/error.h"

namespace regrade {

Appearance ApplyNetwork(const LipschitzNetwork& network, const RadianceField& field,
                        const ProgressFunction& progress) {
  constexpr int64_t kChunk = 1 << 17;  // voxels; 32 MB of features and results
  const std::vector<int32_t> vertex = VertexOfVoxel(*field.geometry);
  const int64_t n = field.geometry->num_voxels();
  Appearance styled = field.appearance;
  const int basis = styled.basis;
  Buffer<float> features(std::min(n, kChunk) * kFeatureStride), output(features.size());
  for (int64_t begin = 0; begin < n; begin += kChunk) {
    const int64_t count = std::min(kChunk, n - begin);
#pragma omp parallel for schedule(static)
    for (int64_t i = 0; i < count; ++i)
      FillFeatures(field, network.data().position_scale, begin + i,
                   vertex[static_cast<size_t>(begin + i)],
                   features.data() + i * kFeatureStride);
    network.Forward(features.data(), count, output.data());
#pragma omp parallel for schedule(static)
    for (int64_t i = 0; i < count; ++i)
      for (int c = 0; c < 3; ++c)
        std::copy_n(output.data() + i * kFeatureStride + c * 9, basis,
                    styled.sh.data() + ((begin + i) * 3 + c) * basis);
    const Verdict verdict =
        Report(progress, static_cast<double>(begin + count), static_cast<double>(n));
    if (verdict == Verdict::kAbort) throw Interrupted();
    if (verdict == Verdict::kFinish) break;
  }
  return styled;
}

}  // namespace regrade
