#include "pipeline/fields/network_file.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/base/error.h"
#include "pipeline/files/npz_file.h"

namespace regrade {
namespace {

constexpr int32_t kNetworkVersion = 2;
constexpr uint64_t kBudget = uint64_t{1} << 20;  // the arrays are 120 KB

// The bound is a product of singular values in double: another machine differs in the last
// digits, a changed weight in the first ones.
constexpr double kBoundTolerance = 1e-9;

[[noreturn]] void RefuseNetwork(const std::string& path, const std::string& why) {
  throw InputError(why, path, "run regrade stylize again");
}

std::string Named(const char* array, int layer) { return Concat(array, "_", layer); }

// Calls visit(name, shape, data) for the arrays of each layer. `Network` is const for writing.
template <typename Network, typename Visitor>
void VisitLayers(Network* network, const Visitor& visit) {
  auto* vectors = network->data().singular_vectors.data();
  for (int l = 0; l < kNetworkLayers; ++l) {
    const int64_t out = network->Outputs(l), in = network->Inputs(l);
    visit(Named("weight", l), {out, in}, network->weight(l));
    visit(Named("bias", l), {out}, network->bias(l));
    visit(Named("k", l), {}, network->bias(l) + out);  // K follows the biases
    visit(Named("u", l), {out}, vectors);
    visit(Named("v", l), {in}, vectors + out);
    vectors += out + in;
  }
}

}  // namespace

void WriteNetworkFile(const std::string& path, const StoredNetwork& stored) {
  const LipschitzNetworkData& data = stored.network.data();
  double matrix[9], offset[3];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) matrix[3 * i + j] = data.base.matrix(i, j);
    offset[i] = data.base.offset[i];
  }
  NpzWriter file;
  VisitLayers(&stored.network,
              [&file](const std::string& name, const std::vector<int64_t>& shape,
                      const float* values) { file.Add(name, shape, values); });
  file.AddText("activation", data.activation);
  file.AddScalar<float>("omega", data.omega);
  file.AddScalar<float>("sh_scale", data.sh_scale);
  file.AddScalar<float>("position_scale", data.position_scale);
  file.AddScalar<uint8_t>("has_base", data.has_base);
  file.Add("base_matrix", {3, 3}, matrix);
  file.Add("base_offset", {3}, offset);
  file.AddScalar<double>("bound", stored.network.Bound());
  file.AddScalar<double>("k_est", stored.k_est);
  file.Add("background", {3}, &stored.background.x);
  file.AddScalar<int32_t>("regrade_version", kNetworkVersion);
  file.WriteTo(path);
}

StoredNetwork ReadNetworkFile(const std::string& path) {
  NpzReader file(path, kBudget);
  RefuseNewerFormat(&file, kNetworkVersion);
  if (const int32_t version = file.ReadScalar<int32_t>("regrade_version");
      version < kNetworkVersion)
    RefuseNetwork(path, Concat("format ", version, ", older than ", kNetworkVersion,
                               ", the only one that is read"));
  const NpzArray last = file.Read(Named("bias", kNetworkLayers - 1), ArrayType::kF32, {-1});
  LipschitzNetwork network(last.shape[0] == kLargestRow.sh() ? kMaxBasis : kMaxVoxelBasis);
  VisitLayers(&network, [&file](const std::string& name, const std::vector<int64_t>& shape,
                                float* values) {
    const NpzArray array = file.Read(name, ArrayType::kF32, shape);
    std::copy_n(array.As<float>(), array.num_elements(), values);
  });
  LipschitzNetworkData data = std::move(network.data());
  data.activation = file.ReadText("activation");
  data.omega = file.ReadScalar<float>("omega");
  data.sh_scale = file.ReadScalar<float>("sh_scale");
  data.position_scale = file.ReadScalar<float>("position_scale");
  data.has_base = file.ReadScalar<uint8_t>("has_base") != 0;
  const NpzArray matrix = file.Read("base_matrix", ArrayType::kF64, {3, 3});
  const NpzArray offset = file.Read("base_offset", ArrayType::kF64, {3});
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) data.base.matrix(i, j) = matrix.As<double>()[3 * i + j];
    data.base.offset[i] = offset.As<double>()[i];
  }
  const NpzArray background = file.Read("background", ArrayType::kF32, {3});
  const float* const color = background.As<float>();
  StoredNetwork stored{LipschitzNetwork(std::move(data)),
                       file.ReadScalar<double>("k_est"),
                       {color[0], color[1], color[2]}};
  if (!std::isfinite(stored.k_est)) RefuseNetwork(path, "k_est is not finite");
  for (int c = 0; c < 3; ++c)
    if (!std::isfinite(color[c])) RefuseNetwork(path, "the background is not finite");
  const double guaranteed = file.ReadScalar<double>("bound"), bound = stored.network.Bound();
  if (!(std::abs(guaranteed - bound) <= kBoundTolerance * bound))
    RefuseNetwork(path, "it guarantees the bound " + std::to_string(guaranteed) +
                            ", its weights have " + std::to_string(bound));
  return stored;
}

}  // namespace regrade
