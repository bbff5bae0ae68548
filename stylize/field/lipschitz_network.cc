#include "stylize/field/lipschitz_network.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>

#include "kernels/base/error.h"
#include "kernels/field/background_spheres.h"
#include "kernels/field/field_kind.h"
#include "kernels/network/lipschitz_layer.h"
#include "stylize/spectral_norm.h"

namespace regrade {
namespace {

constexpr struct {
  const char* name;
  Activation activation;
} kActivations[] = {{"sine", Activation::kSine},
                    {"relu", Activation::kRelu},
                    {"leaky-relu", Activation::kLeakyRelu},
                    {"sigmoid", Activation::kSigmoid},
                    {"tanh", Activation::kTanh}};

// A layer's W, u, v in another scalar, with the memory they live in.
template <typename T>
struct SpectralCopy {
  std::vector<T> weight, u, v;

  SpectralCopy(const LipschitzNetwork& network, int layer) {
    const int outputs = network.Outputs(layer), inputs = network.Inputs(layer);
    const float* w = network.weight(layer);
    weight.assign(w, w + static_cast<int64_t>(outputs) * inputs);
    const float* vectors = network.data().singular_vectors.data() + network.VectorOffset(layer);
    u.assign(vectors, vectors + outputs);
    v.assign(vectors + outputs, vectors + outputs + inputs);
  }
  SpectralView<T> View() {
    return {static_cast<int>(u.size()), static_cast<int>(v.size()), weight.data(), u.data(),
            v.data()};
  }
};

SpectralView<float> ViewOfLayer(LipschitzNetwork* network, int layer) {
  const int outputs = network->Outputs(layer), inputs = network->Inputs(layer);
  float* vectors = network->data().singular_vectors.data() + network->VectorOffset(layer);
  return {outputs, inputs, network->weight(layer), vectors, vectors + outputs};
}

}  // namespace

Activation ActivationByName(const std::string& name) {
  for (const auto& entry : kActivations)
    if (name == entry.name) return entry.activation;
  throw UsageError("unknown activation '" + name + "'", "",
                   "use sine, relu, leaky-relu, sigmoid or tanh");
}

const char* NameOf(Activation activation) {
  for (const auto& entry : kActivations)
    if (activation == entry.activation) return entry.name;
  return "";
}

int LipschitzNetwork::Outputs(int layer) const {
  return layer + 1 == kNetworkLayers ? row().sh() : kMlpHidden;
}
int LipschitzNetwork::Inputs(int layer) const {
  return layer == 0 ? row().inputs() : kMlpHidden;
}
int64_t LipschitzNetwork::NumParameters() const { return WeightOffset(kNetworkLayers); }

int64_t LipschitzNetwork::WeightOffset(int layer) const {
  int64_t offset = 0;
  for (int l = 0; l < layer; ++l)
    offset += static_cast<int64_t>(Outputs(l)) * (Inputs(l) + 1) + 1;
  return offset;
}

int64_t LipschitzNetwork::VectorOffset(int layer) const {
  int64_t offset = 0;
  for (int l = 0; l < layer; ++l) offset += Outputs(l) + Inputs(l);
  return offset;
}

LipschitzNetwork::LipschitzNetwork(int basis) {
  REGRADE_CHECK(basis == kMaxVoxelBasis || basis == kMaxBasis);
  data_.basis = basis;
  data_.parameters.resize(NumParameters());
  data_.singular_vectors.resize(VectorOffset(kNetworkLayers));
}

LipschitzNetwork::LipschitzNetwork(LipschitzNetworkData data) : data_(std::move(data)) {
  const auto refuse = [](const std::string& what) {
    throw InputError("not a network: " + what, "network.npz", "run regrade stylize again");
  };
  if (data_.basis != kMaxVoxelBasis && data_.basis != kMaxBasis)
    refuse(Concat(data_.basis, " harmonics a channel"));
  if (std::ranges::none_of(
          kActivations, [this](const auto& entry) { return data_.activation == entry.name; }))
    refuse("unknown activation '" + data_.activation + "'");
  if (std::ssize(data_.parameters) != NumParameters())
    refuse(Concat(data_.parameters.size(), " parameters instead of ", NumParameters()));
  if (std::ssize(data_.singular_vectors) != VectorOffset(kNetworkLayers))
    refuse("singular vectors of another shape");
  bool finite = std::isfinite(data_.omega) && std::isfinite(data_.sh_scale) &&
                std::isfinite(data_.position_scale) && AllFinite(data_.base.offset);
  for (const auto& row : data_.base.matrix.row) finite &= AllFinite(row);
  for (const float x : data_.parameters) finite &= std::isfinite(x);
  for (const float x : data_.singular_vectors) finite &= std::isfinite(x);
  if (!finite) refuse("a value is not finite");
}

float* LipschitzNetwork::weight(int layer) {
  return data_.parameters.data() + WeightOffset(layer);
}
float* LipschitzNetwork::bias(int layer) {
  return weight(layer) + static_cast<int64_t>(Outputs(layer)) * Inputs(layer);
}
float& LipschitzNetwork::k(int layer) { return bias(layer)[Outputs(layer)]; }

void LipschitzNetwork::RestartNorms() {
  for (int l = 0; l < kNetworkLayers; ++l) StartPowerIteration(ViewOfLayer(this, l));
}

void LipschitzNetwork::WarmUpNorms() {
  for (int l = 0; l < kNetworkLayers; ++l) WarmUpPowerIteration(ViewOfLayer(this, l));
}

void LipschitzNetwork::StepNorms() {
  for (int l = 0; l < kNetworkLayers; ++l) PowerStep(ViewOfLayer(this, l));
}

template <typename T>
DenseNetwork<T> LipschitzNetwork::Effective() const {
  DenseNetwork<T> network;
  network.activation = ActivationByName(data_.activation);
  network.omega = static_cast<T>(data_.omega);
  for (int l = 0; l < kNetworkLayers; ++l) {
    DenseLayer<T> layer(Outputs(l), Inputs(l));
    SpectralCopy<T> copy(*this, l);
    LipschitzWeight(copy.View(), static_cast<T>(k(l)), layer.weight.data());
    std::copy_n(bias(l), Outputs(l), layer.bias.begin());
    if (l == 0)
      for (int o = 0; o < Outputs(l); ++o)
        for (int i = 0; i < row().sh(); ++i)
          layer.weight[static_cast<size_t>(o) * Inputs(l) + i] *=
              static_cast<T>(data_.sh_scale);
    network.layers.push_back(std::move(layer));
  }
  return network;
}

template DenseNetwork<float> LipschitzNetwork::Effective<float>() const;
template DenseNetwork<double> LipschitzNetwork::Effective<double>() const;

void LipschitzNetwork::AddGradient(const DenseNetwork<double>& d_effective,
                                   std::vector<double>* gradient) const {
  REGRADE_CHECK_EQ(std::ssize(*gradient), NumParameters());
  for (int l = 0; l < kNetworkLayers; ++l) {
    std::vector<double> d_a = d_effective.layers[l].weight;
    if (l == 0)
      for (int o = 0; o < Outputs(l); ++o)
        for (int i = 0; i < row().sh(); ++i)
          d_a[static_cast<size_t>(o) * Inputs(l) + i] *= data_.sh_scale;
    double* d_weight = gradient->data() + WeightOffset(l);
    double* d_bias = d_weight + static_cast<int64_t>(Outputs(l)) * Inputs(l);
    for (int o = 0; o < Outputs(l); ++o) d_bias[o] += d_effective.layers[l].bias[o];
    SpectralCopy<double> copy(*this, l);
    LipschitzWeightAdjoint(copy.View(), static_cast<double>(k(l)), d_a.data(), d_weight,
                           d_bias + Outputs(l));
  }
}

void LipschitzNetwork::Forward(const float* features, int64_t n, float* output) const {
  FusedForward(MakeFusedMlp(Effective<float>()), features, n, output);
  if (!data_.has_base) return;
#pragma omp parallel for schedule(static)
  for (int64_t r = 0; r < n; ++r)
    AddBaseMap(data_.base, data_.basis, features + r * row().stride(),
               output + r * row().stride());
}

void LipschitzNetwork::ForwardPlain(const double* features, double* output) const {
  DenseForward(Effective<double>(), features, output);
  if (data_.has_base) AddBaseMap(data_.base, data_.basis, features, output);
}

double LipschitzNetwork::BaseNorm() const {
  return data_.has_base ? SpectralNorm(data_.base.matrix) : 0;
}

double LipschitzNetwork::LearnedBound() const {
  const DenseNetwork<double> network = Effective<double>();
  double bound =
      std::pow(ActivationLipschitz(network.activation, network.omega), kNetworkLayers - 1);
  for (const DenseLayer<double>& layer : network.layers)
    bound *= SpectralNorm(layer.weight, layer.outputs, layer.inputs);
  return bound;
}

double LipschitzNetwork::NormEstimate(int layer) const {
  SpectralCopy<double> copy(*this, layer);
  const double scale = LargestMagnitude(copy.View());
  return scale * FrozenSigma(copy.View(), scale);
}

double LipschitzNetwork::NormDrift() const {
  double drift = 0;
  for (int l = 0; l < kNetworkLayers; ++l) {
    const double estimate = NormEstimate(l);
    const double exact =
        SpectralNorm(SpectralCopy<double>(*this, l).weight, Outputs(l), Inputs(l));
    if (estimate > 0) drift = std::max(drift, exact / estimate - 1);
  }
  return drift;
}

double LipschitzNetwork::SmallestK() const {
  double smallest = Squareplus<double>(k(0));
  for (int l = 1; l < kNetworkLayers; ++l)
    smallest = std::min(smallest, Squareplus<double>(k(l)));
  return smallest;
}

std::vector<int32_t> VertexOfVoxel(const Geometry& geometry) {
  std::vector<int32_t> vertex(geometry.num_voxels(), -1);
  if (geometry.links.size() == 0) std::iota(vertex.begin(), vertex.end(), 0);
  for (int64_t i = 0; i < geometry.links.size(); ++i)
    if (geometry.links[i] >= 0) vertex[geometry.links[i]] = static_cast<int32_t>(i);
  return vertex;
}

void FillFeatures(const RadianceField& field, float position_scale, int64_t voxel,
                  int32_t vertex, float* row) {
  const int basis = field.appearance.basis;
  const NetworkRow shape = RowOf(basis);
  const float* sh = field.appearance.sh.data() + voxel * field.appearance.stride();
  std::fill_n(row, shape.stride(), 0.0f);
  for (int c = 0; c < 3; ++c) std::copy_n(sh + c * basis, basis, row + c * shape.basis);
  const Vec3f position = KindOf(*field.geometry).position_of(*field.geometry, voxel, vertex);
  for (int a = 0; a < 3; ++a) row[shape.sh() + a] = position_scale * position[a];
}

void FillTexelFeatures(const RadianceField& field, float position_scale, int64_t texel,
                       int32_t at, float* row) {
  const int resolution = field.geometry->spheres.resolution;
  const NetworkRow shape = RowOf(field.appearance.basis);
  std::fill_n(row, shape.stride(), 0.0f);
  for (int c = 0; c < 3; ++c)
    row[c * shape.basis] = field.appearance.sphere_color[3 * texel + c];
  const Vec3f direction = TexelDirection<float>(resolution, at / resolution, at % resolution);
  for (int a = 0; a < 3; ++a) row[shape.sh() + a] = position_scale * direction[a];
}

std::vector<int32_t> PlaceOfColumn(const SphereGeometry& spheres) {
  std::vector<int32_t> place(spheres.num_columns());
  for (int64_t at = 0; at < spheres.links.size(); ++at)
    if (spheres.links[at] >= 0) place[spheres.links[at]] = static_cast<int32_t>(at);
  return place;
}

}  // namespace regrade
