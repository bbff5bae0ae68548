#include "pipeline/page/style_codec.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "kernels/base/half.h"
#include "kernels/network/fused_mlp.h"
#include "pipeline/files/deflate.h"
#include "pipeline/page/color_code.h"
#include "stylize/field/apply_network.h"
#include "stylize/field/base_map.h"
#include "stylize/training/restyle_field.h"

namespace regrade {
namespace {

// Rounds `values` and appends them to `bytes`, the low byte first.
void RoundToHalves(std::vector<float>* values, std::string* bytes) {
  for (float& value : *values) {
    const uint16_t half = HalfFromFloat(value);
    bytes->push_back(static_cast<char>(half & 255));
    bytes->push_back(static_cast<char>(half >> 8));
    value = FloatFromHalf(half);
  }
}

ColorCode RoundToWords(const Geometry& geometry, Buffer<float>* sh) {
  std::vector<int64_t> splat(static_cast<size_t>(geometry.num_voxels()));
  std::iota(splat.begin(), splat.end(), 0);
  const ColorRows rows{sh->data(), kStyledBasis, splat};
  const std::vector<float> opacity = LightOfSplats(geometry);
  std::vector<float> values, spread, weight;
  for (const size_t i : FittedRows(rows.size())) {
    weight.push_back(opacity[i]);
    for (int c = 0; c < 3 * kStyledBasis; ++c) {
      values.push_back(rows[i][c]);
      spread.push_back(rows[i][c] * std::sqrt(weight.back()));
    }
  }
  const ColorCode code = FitColorCode(spread, values, kStyledBasis, 0, weight);
  PutValues(NumbersOf(rows, code), code, kStyledBasis, splat, sh->data());
  return code;
}

// The effective layers on the harmonics that a page has: of a network of degree 3 what it makes
// of colours without the higher ones, which are not computed either. No steeper than all of it.
DenseNetwork<float> OfPagesHarmonics(const LipschitzNetwork& network) {
  DenseNetwork<float> dense = network.Effective<float>();
  const int basis = network.row().basis;
  if (basis == kStyledBasis) return dense;
  const NetworkRow row{kStyledBasis};
  const DenseLayer<float>&first = dense.layers.front(), &last = dense.layers.back();
  // The place among all values of a row of value i of the page's.
  const auto place = [&](int i) {
    return i < row.sh() ? i / row.basis * basis + i % row.basis : i - row.sh() + 3 * basis;
  };
  DenseLayer<float> inputs(first.outputs, row.inputs()), outputs(row.sh(), last.inputs);
  inputs.bias = first.bias;
  for (int o = 0; o < inputs.outputs; ++o)
    for (int i = 0; i < inputs.inputs; ++i)
      inputs.weight[static_cast<size_t>(o) * inputs.inputs + i] =
          first.weight[static_cast<size_t>(o) * first.inputs + place(i)];
  for (int o = 0; o < outputs.outputs; ++o) {
    outputs.bias[o] = last.bias[place(o)];
    std::copy_n(last.weight.begin() + place(o) * last.inputs, last.inputs,
                outputs.weight.begin() + o * last.inputs);
  }
  dense.layers.front() = std::move(inputs);
  dense.layers.back() = std::move(outputs);
  return dense;
}

}  // namespace

PageStyle EncodeStyle(const StoredNetwork& stored, const RadianceField& page, double strength) {
  return EncodeStyle(stored, page, strength, {}, {});
}

PageStyle EncodeStyle(const StoredNetwork& stored, const RadianceField& page, double strength,
                      const StyleLayers& layers, const PageRecords& places) {
  const LipschitzNetworkData& data = stored.network.data();
  DenseNetwork<float> dense = OfPagesHarmonics(stored.network);
  std::string halves;
  for (DenseLayer<float>& layer : dense.layers) {
    RoundToHalves(&layer.weight, &halves);
    RoundToHalves(&layer.bias, &halves);
  }
  const FusedMlp fused = MakeFusedMlp(dense);
  PageStyle style;
  style.styled = {page.geometry, {}, stored.background, page.near_clip, page.march};
  style.styled.appearance = ApplyForward(
      [&](const float* features, int64_t n, float* output) {
        FusedForward(fused, features, n, output);
        if (!data.has_base) return;
        for (int64_t r = 0; r < n; ++r)
          AddBaseMap(data.base, kStyledBasis, features + r * fused.ends,
                     output + r * fused.ends);
      },
      data.position_scale, page);
  JsonValue residual;
  if (!layers.empty()) {
    PageResidual packed = EncodeResidual(layers, places.earlier);
    ApplyLayers(packed.rounded, places.splat, page, &style.styled);
    style.residual = std::move(packed.packed);
    residual = std::move(packed.header);
  }
  const ColorCode code = RoundToWords(*page.geometry, &style.styled.appearance.sh);
  const RowMap base = BaseOf(data);
  JsonValue::Array matrix;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) matrix.push_back(double{base.matrix.row[r][c]});
  const auto array = [](const Vec3f& v) {
    return JsonValue::Array{double{v.x}, double{v.y}, double{v.z}};
  };
  style.header = JsonValue::Object{{"activation", static_cast<int>(dense.activation)},
                                   {"omega", double{data.omega}},
                                   {"position_scale", double{data.position_scale}},
                                   {"base", std::move(matrix)},
                                   {"constant", array(base.constant)},
                                   {"color", JsonOf(code)},
                                   {"background", array(style.styled.background)},
                                   {"residual", std::move(residual)},
                                   {"strength", strength},
                                   {"bound", stored.network.Bound()}};
  style.packed = Deflate(halves);
  return style;
}

std::string StyledWords(const PageStyle& style, const std::vector<int64_t>& splats) {
  const ColorCode code = ColorCodeOf(style.header.At("color"));
  return WordsOf(NumbersOf({style.styled.appearance.sh.data(), kStyledBasis, splats}, code),
                 code);
}

}  // namespace regrade
