// Body of the fused network, compiled once per instruction set: define REGRADE_SIMD_NAMESPACE
// and REGRADE_SIMD_NAME before including it. It uses GCC's vector types only.
//
// Rows are voxels and lanes are neurons, so that forward (X A^T), input gradient (D A) and
// weight gradient (D^T X) are the same small matrix product.
//
// No code here may instantiate a template or call an inline function that the linker could
// share with other files: the shared copy might be the one compiled for a newer processor. So
// memory comes from the caller, and only trivial accessors are used.
#include <cmath>
#include <cstring>

#include "kernels/network/fused_mlp.h"

namespace regrade::REGRADE_SIMD_NAMESPACE {
namespace {

#if defined(__AVX512F__)
constexpr int kWidth = 16, kVectors = 4;
#elif defined(__AVX2__)
constexpr int kWidth = 8, kVectors = 2;
#else
constexpr int kWidth = 4, kVectors = 2;
#endif
constexpr int kTileRows = 4;
constexpr int kBlock = kMlpBlock;

typedef float Vector __attribute__((vector_size(kWidth * sizeof(float)), aligned(4)));
typedef int32_t IntVector __attribute__((vector_size(kWidth * sizeof(float)), aligned(4)));

inline Vector Load(const float* p) { return *reinterpret_cast<const Vector*>(p); }
inline void Store(float* p, Vector v) { *reinterpret_cast<Vector*>(p) = v; }

// c[r][..] = start + sum_k a[r a_row + k a_k] b[k][..] for kTileRows rows and kV vectors of
// lanes.
template <int kV>
inline void Tile(int depth, const float* a, int64_t a_row, int64_t a_k, const float* b,
                 int64_t b_row, const float* start, int64_t start_row, float* c,
                 int64_t c_row) {
  Vector sum[kTileRows][kV];
#pragma GCC unroll 8
  for (int r = 0; r < kTileRows; ++r)
#pragma GCC unroll 8
    for (int v = 0; v < kV; ++v) sum[r][v] = Load(start + r * start_row + v * kWidth);
  for (int k = 0; k < depth; ++k) {
    Vector row[kV];
#pragma GCC unroll 8
    for (int v = 0; v < kV; ++v) row[v] = Load(b + k * b_row + v * kWidth);
#pragma GCC unroll 8
    for (int r = 0; r < kTileRows; ++r) {
      const float x = a[r * a_row + k * a_k];
#pragma GCC unroll 8
      for (int v = 0; v < kV; ++v) sum[r][v] += x * row[v];
    }
  }
#pragma GCC unroll 8
  for (int r = 0; r < kTileRows; ++r)
#pragma GCC unroll 8
    for (int v = 0; v < kV; ++v) Store(c + r * c_row + v * kWidth, sum[r][v]);
}

// The whole product; `rows` is a multiple of kTileRows, `lanes` of 32. start_row 0 repeats one
// row (a bias); start = c accumulates.
inline void Multiply(int rows, int lanes, int depth, const float* a, int64_t a_row, int64_t a_k,
                     const float* b, const float* start, int64_t start_row, float* c) {
  constexpr int kV = kVectors, kHalf = kVectors > 2 ? kVectors / 2 : kVectors;
  for (int r = 0; r < rows; r += kTileRows) {
    int l = 0;
    for (; l + kV * kWidth <= lanes; l += kV * kWidth)
      Tile<kV>(depth, a + r * a_row, a_row, a_k, b + l, lanes, start + r * start_row + l,
               start_row, c + static_cast<int64_t>(r) * lanes + l, lanes);
    for (; l < lanes; l += kHalf * kWidth)
      Tile<kHalf>(depth, a + r * a_row, a_row, a_k, b + l, lanes, start + r * start_row + l,
                  start_row, c + static_cast<int64_t>(r) * lanes + l, lanes);
  }
}

inline Vector Select(IntVector mask, Vector a, Vector b) { return mask ? a : b; }

// Reduction by pi/2 in three parts (the first two have few bits, so that n * part is exact for
// |n| <= 64), then Cephes' polynomials on [-pi/4, pi/4].
inline void SineCosine(Vector x, Vector* sine, Vector* cosine) {
  const Vector magnitude = Select(x < 0.0f, -x, x);
  const IntVector small = magnitude <= 50.0f;
  bool all_small = true;
  for (int l = 0; l < kWidth; ++l) all_small &= small[l] != 0;
  if (!all_small) {
    *sine = *cosine = x;
    for (int l = 0; l < kWidth; ++l) {
      (*sine)[l] = std::sin(x[l]);
      (*cosine)[l] = std::cos(x[l]);
    }
    return;
  }
  constexpr float kRound = 12582912.0f;  // 1.5 * 2^23: adding it rounds to an integer
  const Vector shifted = x * 0.636619772f + kRound;
  const Vector n = shifted - kRound;
  IntVector quadrant;
  std::memcpy(&quadrant, &shifted, sizeof quadrant);
  Vector r = x - n * 1.5703125f;
  r -= n * 4.837512969970703125e-4f;
  r -= n * 7.54978995489188e-8f;
  const Vector r2 = r * r;
  const Vector s =
      r + r * r2 * (-1.6666654611e-1f + r2 * (8.3321608736e-3f + r2 * -1.9515295891e-4f));
  const Vector c =
      1.0f - 0.5f * r2 +
      r2 * r2 *
          (4.166664568298827e-2f + r2 * (-1.388731625493765e-3f + r2 * 2.443315711809948e-5f));
  const IntVector odd = (quadrant & 1) != 0;
  const Vector sin_r = Select(odd, c, s), cos_r = Select(odd, s, c);
  *sine = Select((quadrant & 2) != 0, -sin_r, sin_r);
  *cosine = Select(((quadrant + 1) & 2) != 0, -cos_r, cos_r);
}

// x becomes act(x); slope, unless null, act'(x).
void ActivateRows(Activation activation, float omega, int n, float* x, float* slope) {
  if (activation != Activation::kSine) {
    ActivateRowsPlain(activation, omega, n, x, slope);
    return;
  }
  for (int i = 0; i < n; i += kWidth) {
    Vector s, c;
    SineCosine(omega * Load(x + i), &s, &c);
    Store(x + i, s);
    if (slope != nullptr) Store(slope + i, omega * c);
  }
}

// The caller's memory, partitioned: every layer's input, and the derivatives of the activation
// before it.
struct Workspace {
  float* input[kMlpMaxLayers];
  float* slope[kMlpMaxLayers];
  float *output, *d, *d_next, *zero;

  Workspace(const FusedMlp& mlp, float* memory) {
    for (size_t l = 0; l < mlp.layers.size(); ++l) {
      input[l] = memory;
      slope[l] = memory + kBlock * mlp.layers[l].inputs;
      memory += 2 * kBlock * mlp.layers[l].inputs;
    }
    output = memory;
    d = output + kBlock * mlp.ends;
    d_next = d + kBlock * kMlpHidden;
    zero = d_next + kBlock * kMlpHidden;
    std::memset(zero, 0, sizeof(float) * kMlpHidden);
  }
};

void ForwardBlock(const FusedMlp& mlp, const float* input, int rows, bool slopes,
                  const Workspace& work) {
  std::memcpy(work.input[0], input, sizeof(float) * rows * mlp.ends);
  std::memset(work.input[0] + rows * mlp.ends, 0, sizeof(float) * (kBlock - rows) * mlp.ends);
  for (size_t l = 0; l < mlp.layers.size(); ++l) {
    const FusedMlp::Layer& layer = mlp.layers[l];
    const bool last = l + 1 == mlp.layers.size();
    float* out = last ? work.output : work.input[l + 1];
    Multiply(kBlock, layer.outputs, layer.inputs, work.input[l], layer.inputs, 1,
             layer.transposed.data(), layer.bias.data(), 0, out);
    if (!last)
      ActivateRows(mlp.activation, mlp.omega, kBlock * layer.outputs, out,
                   slopes ? work.slope[l + 1] : nullptr);
  }
}

int BlockRows(int64_t begin, int64_t n) {
  return n - begin < kBlock ? static_cast<int>(n - begin) : kBlock;
}

void Forward(const FusedMlp& mlp, const float* input, int64_t n, float* output, float* memory) {
  const Workspace work(mlp, memory);
  for (int64_t begin = 0; begin < n; begin += kBlock) {
    const int rows = BlockRows(begin, n);
    ForwardBlock(mlp, input + begin * mlp.ends, rows, false, work);
    std::memcpy(output + begin * mlp.ends, work.output, sizeof(float) * rows * mlp.ends);
  }
}

// d [kBlock, outputs] is dL/d(sum before the activation of layer l). Adds to d_weight, d_bias.
void AddLayerGradient(const FusedMlp::Layer& layer, const float* input, const float* d,
                      float* d_weight) {
  Multiply(layer.outputs, layer.inputs, kBlock, d, 1, layer.outputs, input, d_weight,
           layer.inputs, d_weight);
  float* d_bias = d_weight + static_cast<int64_t>(layer.outputs) * layer.inputs;
  for (int o = 0; o < layer.outputs; o += kWidth) {
    Vector sum = Load(d_bias + o);
    for (int r = 0; r < kBlock; ++r) sum += Load(d + r * layer.outputs + o);
    Store(d_bias + o, sum);
  }
}

void Adjoint(const FusedMlp& mlp, const float* input, const float* d_output, int64_t n,
             float* partial, float* memory) {
  const Workspace work(mlp, memory);
  for (int64_t begin = 0; begin < n; begin += kBlock) {
    const int rows = BlockRows(begin, n);
    ForwardBlock(mlp, input + begin * mlp.ends, rows, true, work);
    float* d = work.d;
    float* d_next = work.d_next;
    std::memcpy(d, d_output + begin * mlp.ends, sizeof(float) * rows * mlp.ends);
    std::memset(d + rows * mlp.ends, 0, sizeof(float) * (kBlock - rows) * mlp.ends);
    for (size_t l = mlp.layers.size(); l-- > 0;) {
      const FusedMlp::Layer& layer = mlp.layers[l];
      AddLayerGradient(layer, work.input[l], d, partial + mlp.Offset(l));
      if (l == 0) break;
      Multiply(kBlock, layer.inputs, layer.outputs, d, layer.outputs, 1, layer.weight.data(),
               work.zero, 0, d_next);
      for (int i = 0; i < kBlock * layer.inputs; i += kWidth)
        Store(d_next + i, Load(d_next + i) * Load(work.slope[l] + i));
      float* const swap = d;
      d = d_next;
      d_next = swap;
    }
  }
}

void SineCosineRow(const float* x, int64_t n, float* sine, float* cosine) {
  for (int64_t i = 0; i < n; i += kWidth) {
    float in[kWidth] = {}, out_s[kWidth], out_c[kWidth];
    const size_t bytes = sizeof(float) * (n - i < kWidth ? n - i : kWidth);
    std::memcpy(in, x + i, bytes);
    Vector s, c;
    SineCosine(Load(in), &s, &c);
    Store(out_s, s);
    Store(out_c, c);
    std::memcpy(sine + i, out_s, bytes);
    std::memcpy(cosine + i, out_c, bytes);
  }
}

}  // namespace

extern const FusedMlpFunctions kFusedMlp;
const FusedMlpFunctions kFusedMlp = {REGRADE_SIMD_NAME, Forward, Adjoint, SineCosineRow};

}  // namespace regrade::REGRADE_SIMD_NAMESPACE
