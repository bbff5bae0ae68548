#include "pipeline/fields/network_file.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <utility>

#include "kernels/base/random.h"
#include "pipeline/fields/network_checkpoint.h"
#include "pipeline/files/npz_file.h"
#include "tests/support/expect_error.h"
#include "tests/support/small_archive.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::ReadText;
using testing::TemporaryFolder;

float Random(uint64_t stream, size_t i) {
  return static_cast<float>(RandomDouble(5, stream, i) - 0.5);
}

// All values differ, so that exchanged ones are detected.
StoredNetwork SmallNetwork(int basis = 9) {
  LipschitzNetworkData data = LipschitzNetwork(basis).data();
  for (size_t i = 0; i < data.parameters.size(); ++i) data.parameters[i] = Random(1, i);
  for (size_t i = 0; i < data.singular_vectors.size(); ++i)
    data.singular_vectors[i] = Random(2, i);
  data.activation = "tanh";
  data.omega = 1.25f;
  data.sh_scale = 2.5f;
  data.position_scale = 0.75f;
  data.has_base = true;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) data.base.matrix(i, j) = 1.0 / (1 + 3 * i + j);
    data.base.offset[i] = -0.1 * (i + 1);
  }
  StoredNetwork stored{LipschitzNetwork(data), 1.0 / 3, {0.25f, 0.5f, 0.75f}};
  stored.network.WarmUpNorms();
  for (int l = 0; l < kNetworkLayers; ++l)
    stored.network.k(l) = 1 + 0.1f * static_cast<float>(l);
  return stored;
}

bool SameBits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

class NetworkFileOf : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Harmonics, NetworkFileOf, ::testing::Values(9, 16));

TEST_P(NetworkFileOf, RoundTripKeepsAllBits) {
  const TemporaryFolder folder;
  const StoredNetwork out = SmallNetwork(GetParam());
  WriteNetworkFile(folder / "network.npz", out);
  const StoredNetwork in = ReadNetworkFile(folder / "network.npz");
  const LipschitzNetworkData &a = out.network.data(), &b = in.network.data();
  EXPECT_EQ(b.basis, GetParam());
  EXPECT_TRUE(SameBits(a.parameters, b.parameters));
  EXPECT_TRUE(SameBits(a.singular_vectors, b.singular_vectors));
  EXPECT_EQ(b.activation, "tanh");
  EXPECT_EQ(b.omega, a.omega);
  EXPECT_EQ(b.sh_scale, a.sh_scale);
  EXPECT_EQ(b.position_scale, a.position_scale);
  EXPECT_TRUE(b.has_base);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(b.base.matrix.row[i], a.base.matrix.row[i]);
  EXPECT_EQ(b.base.offset, a.base.offset);
  EXPECT_EQ(in.k_est, out.k_est);
  EXPECT_EQ(in.network.Bound(), out.network.Bound());
  // Written again, it is the same file.
  WriteNetworkFile(folder / "again.npz", in);
  EXPECT_EQ(ReadText(folder / "again.npz"), ReadText(folder / "network.npz"));
}

TEST(NetworkCheckpoint, KeepsBothMaps) {
  TrainingState state;
  state.network = SmallNetwork(16).network.data();
  state.linear_map_mse = 1.0 / 7;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) state.linear_map.matrix(i, j) = 1.0 / (20 + 3 * i + j);
    state.linear_map.offset[i] = 0.3 * (i + 1);
  }
  const auto back = UnpackTrainingState(PackTrainingState(state));
  ASSERT_TRUE(back);
  for (const auto& [in, out] : {std::pair{back->linear_map, state.linear_map},
                                std::pair{back->network.base, state.network.base}}) {
    for (int i = 0; i < 3; ++i) EXPECT_EQ(in.matrix.row[i], out.matrix.row[i]);
    EXPECT_EQ(in.offset, out.offset);
  }
  EXPECT_EQ(back->linear_map_mse, state.linear_map_mse);
  EXPECT_EQ(back->network.basis, 16);
}

TEST(NetworkFile, ArraysHaveTheirNames) {
  const TemporaryFolder folder;
  const StoredNetwork out = SmallNetwork();
  WriteNetworkFile(folder / "network.npz", out);
  NpzReader file(folder / "network.npz", 1 << 20);
  const NpzArray last = file.Read("weight_5", ArrayType::kF32, {27, 64});
  EXPECT_EQ(last.As<float>()[26 * 64 + 63], out.network.weight(5)[26 * 64 + 63]);
  file.Read("weight_0", ArrayType::kF32, {64, 30});
  file.Read("u_5", ArrayType::kF32, {27});
  EXPECT_EQ(file.ReadScalar<float>("k_3"), out.network.k(3));
  // u^T W v is the norm that the network uses.
  const NpzArray u = file.Read("u_1", ArrayType::kF32, {64}),
                 v = file.Read("v_1", ArrayType::kF32, {64}),
                 w = file.Read("weight_1", ArrayType::kF32, {64, 64});
  double norm = 0;
  for (int o = 0; o < 64; ++o)
    for (int i = 0; i < 64; ++i)
      norm +=
          static_cast<double>(u.As<float>()[o]) * w.As<float>()[64 * o + i] * v.As<float>()[i];
  EXPECT_NEAR(norm, out.network.NormEstimate(1), 1e-6 * norm);  // u, v are rounded to float
  EXPECT_EQ(file.ReadScalar<double>("bound"), out.network.Bound());
}

class ChangedNetwork : public ::testing::Test {
 protected:
  // Writes the file with one array replaced, and reads it.
  template <typename T>
  void ReadWith(const std::string& name, const std::vector<int64_t>& shape, const T* data) {
    WriteNetworkFile(folder_ / "network.npz", SmallNetwork());
    testing::ReplaceArray(folder_ / "network.npz", folder_ / "changed.npz", name, shape, data);
    ReadNetworkFile(folder_ / "changed.npz");
  }

  TemporaryFolder folder_;
};

TEST_F(ChangedNetwork, F66_ShapesThatDisagree) {
  const std::vector<float> row(64 * 31, 0.5f);
  EXPECT_REGRADE_ERROR(ReadWith("weight_0", {64, 31}, row.data()), ExitCode::kInput,
                       "weight_0");
}

TEST_F(ChangedNetwork, F69_NonFiniteValues) {
  std::vector<float> bias(64, 0.5f);
  bias[63] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_REGRADE_ERROR(ReadWith("bias_2", {64}, bias.data()), ExitCode::kInput, "not finite");
  const double k_est = std::numeric_limits<double>::infinity();
  EXPECT_REGRADE_ERROR(ReadWith("k_est", {}, &k_est), ExitCode::kInput, "k_est");
  const float black_hole[] = {0, std::numeric_limits<float>::quiet_NaN(), 0};
  EXPECT_REGRADE_ERROR(ReadWith("background", {3}, black_hole), ExitCode::kInput, "background");
}

TEST_F(ChangedNetwork, BoundIsOfTheWeights) {
  const double guaranteed = SmallNetwork().network.Bound() * 0.999;
  EXPECT_REGRADE_ERROR(ReadWith("bound", {}, &guaranteed), ExitCode::kInput,
                       "guarantees the bound");
  const float k = 7;
  EXPECT_REGRADE_ERROR(ReadWith("k_4", {}, &k), ExitCode::kInput, "guarantees the bound");
  const double none = std::numeric_limits<double>::quiet_NaN();
  EXPECT_REGRADE_ERROR(ReadWith("bound", {}, &none), ExitCode::kInput, "guarantees the bound");
}

TEST_F(ChangedNetwork, UnknownActivationAndOtherVersions) {
  const std::string name = "swish";
  const auto* bytes = reinterpret_cast<const uint8_t*>(name.data());
  EXPECT_REGRADE_ERROR(ReadWith("activation", {5}, bytes), ExitCode::kInput, "swish");
  const int32_t newer = 99, older = 1;
  EXPECT_REGRADE_ERROR(ReadWith("regrade_version", {}, &newer), ExitCode::kInput, "format 99");
  EXPECT_REGRADE_ERROR(ReadWith("regrade_version", {}, &older), ExitCode::kInput,
                       "run regrade stylize again");
}

}  // namespace
}  // namespace regrade
