#version 300 es
// One ray for each pixel through a grid of voxels and background spheres (SPHERES), with the colours of up to SETS mixed; see
// the C++ headers kernels/field/ray_march.h and background_spheres.h.
precision highp float;
precision highp int;
precision highp isampler2D;
precision highp usampler2D;

uniform usampler2D uTree;      // see tree.js
uniform usampler2D uCorner;    // of a cell: eight numbers of 16 bits, voxels of its block
uniform isampler2D uBase;      // the first voxel of a block of 1024 cells, see decode.js
uniform usampler2D uColor0, uColor1, uColor2;  // of a voxel, see color_code.js
#if SPHERES
uniform isampler2D uColumn;    // of the spheres' map
uniform usampler2D uTexel0, uTexel1, uTexel2;  // codes, density
uniform float uTexelScale[9];
uniform int uLayers, uResolution;
#endif

//@colors
uniform vec3 uBackground;
uniform mat3 uWorldFromCamera;
uniform vec3 uEye;
uniform vec4 uLens;            // focal lengths and principal point, pixels
uniform vec2 uSize, uNdc;
uniform ivec3 uVoxels, uTop;
uniform int uFinest;
uniform vec3 uCenter, uRadius;
uniform float uUnit, uNear, uStep, uOpacityStep;
out vec4 color;

const float kOpticalDepth = 4e-4;
const int kBits = 11;          // textures are 2048 wide
const float kStop = 1e-4, kStopOfStep = 0.2;  // transmittance where a ray ends; of an opacity step
const float kLeastCorner = 0.6;               // weight times opacity of the least corner, of a squared opacity step

ivec2 At(int i) { return ivec2(i & 2047, i >> kBits); }

// The nodes above the texel that was found last, from the top; the one at depth i is 2^(uFinest - 2 i) wide.
uvec4 nodes[10];
ivec3 before;
int depthBefore = -1;

uint Ones(uint w) {
  w -= w >> 1 & 0x55555555u;
  w = (w & 0x33333333u) + (w >> 2 & 0x33333333u);
  return ((w + (w >> 4) & 0x0f0f0f0fu) * 0x01010101u) >> 24;
}

uint Eighth(ivec3 bit) { return uint(bit.x << 2 | bit.y << 1 | bit.z); }

// The texel of the cell around a place, or one of bit 31 where nothing is; the width is that of the cell or the empty cube.
uvec4 TexelAt(ivec3 at, out int width) {
  // The search goes on from the smallest node that holds both places.
  ivec3 differ = at ^ before;
  int depth = depthBefore, shift = uFinest - 2 * depth, bits = differ.x | differ.y | differ.z;
  while (depth >= 0 && bits >> shift != 0) {
    --depth;
    shift += 2;
  }
  uvec4 texel;
  if (depth >= 0) {
    texel = nodes[depth];
  } else {
    depth = 0;
    shift = uFinest;
    ivec3 top = at >> shift;
    texel = texelFetch(uTree, At((top.x * uTop.y + top.y) * uTop.z + top.z), 0);
  }
  for (; texel.x >> 31 == 1u && (texel.z | texel.w) != 0u; ++depth) {
    nodes[depth] = texel;
    uint child = Eighth((at >> (shift - 1)) & 1), half_ = child >> 2;
    uint word = half_ == 0u ? texel.z : texel.w, first = 8u * (child & 3u);
    --shift;
    if ((word >> first & 255u) == 0u) {
      texel = uvec4(1u << 31, 0u, 0u, 0u);
      ++depth;
      break;
    }
    --shift;
    first += Eighth((at >> shift) & 1);
    if ((word >> first & 1u) == 0u) {
      texel = uvec4(1u << 31, 0u, 0u, 0u);
      ++depth;
      break;
    }
    uint earlier = Ones(word & (1u << first) - 1u) + (half_ == 0u ? 0u : Ones(texel.z));
    texel = texelFetch(uTree, At(int((texel.x & 0x7fffffffu) + earlier)), 0);
  }
  before = at;
  depthBefore = depth - 1;
  width = 1 << shift;
  return texel;
}

// Corner weights: x is the highest bit.
void Weights(vec3 f, out vec4 low, out vec4 high) {
  vec4 yz = vec4((1.0 - f.y) * (1.0 - f.z), (1.0 - f.y) * f.z, f.y * (1.0 - f.z), f.y * f.z);
  low = yz * (1.0 - f.x);
  high = yz * f.x;
}

float DensityIn(uvec4 cell, vec3 f) {
  vec4 a, b;
  Weights(f, a, b);
  vec4 low = vec4(cell.y & 4095u, cell.y >> 12 & 4095u, cell.z & 4095u, cell.z >> 12 & 4095u) - 2048.0;
  vec4 high = vec4(cell.w & 4095u, cell.w >> 12 & 4095u, cell.y >> 24 | (cell.z >> 16 & 0xf00u),
                   cell.z >> 28 | (cell.w >> 20 & 0xff0u)) - 2048.0;
  return (dot(a, low * abs(low)) + dot(b, high * abs(high))) * (kOpticalDepth / 16.0);
}

vec4 Codes(uint w) {
  return vec4(w & 255u, w >> 8 & 255u, w >> 16 & 255u, w >> 24) - 128.0;
}

vec3 ColorAt(usampler2D colors, int voxel, int set, vec3 s[9]) {
  return ColorOf(texelFetch(colors, At(voxel), 0), set, s);
}

vec3 s0[9];
#if SETS > 1
vec3 s1[9], s2[9];
#endif

vec3 Shade(int cell, vec3 f, float opacity) {
  uvec4 corners = texelFetch(uCorner, At(cell), 0);
  int base = texelFetch(uBase, At(cell >> 10), 0).x;
  vec4 a, b;
  Weights(f, a, b);
  // With opacity steps, corners that change the pixel little are left out, and the others make up for them. The
  // largest of eight weights is never below 1/8.
  float least = min(0.12, kLeastCorner * uOpacityStep * uOpacityStep / max(opacity, 1e-6)), kept = 0.0;
  for (int k = 0; k < 8; ++k)
    if ((k < 4 ? a[k] : b[k - 4]) >= least) kept += k < 4 ? a[k] : b[k - 4];
  if (least > 0.0) {
    a /= kept;
    b /= kept;
    least /= kept;
  }
  vec3 y0 = vec3(0.0);
#if SETS > 1
  vec3 y1 = vec3(0.0), y2 = vec3(0.0);
#endif
  for (int k = 0; k < 8; ++k) {
    float w = k < 4 ? a[k] : b[k - 4];
    if (w < least) continue;
    int voxel = base + int(corners[k >> 1] >> (16 * (k & 1)) & 65535u);
    if (uWeight.x > 0.0) y0 += w * ColorAt(uColor0, voxel, 0, s0);
#if SETS > 1
    if (uWeight.y > 0.0) y1 += w * ColorAt(uColor1, voxel, 1, s1);
    if (uWeight.z > 0.0) y2 += w * ColorAt(uColor2, voxel, 2, s2);
#endif
  }
  vec3 raw = 0.5 + uWeight.x * (uOpponent[0] * y0);
#if SETS > 1
  raw += uWeight.y * (uOpponent[1] * y1) + uWeight.z * (uOpponent[2] * y2);
#endif
  return max(uMap * raw + uOffset, 0.0);
}

// The sums of a ray: light, what is transmitted, opacity that has no colour yet, and the sample at its middle, whose
// colour it gets: the error is of second order in the step, where the last sample's is of first order.
vec3 sum = vec3(0.0);
float transmitted = 1.0, waiting = 0.0;
int middleCell = -1;
vec3 middleFraction;

bool Ended() { return transmitted < max(kStop, kStopOfStep * uOpacityStep); }

void Composite(int cell, vec3 f, float density, float delta) {
  float tau = min(max(density, 0.0) * delta, 104.0);
  if (!(tau > 0.0)) return;
  // 1 - exp(-tau) of a small tau loses its digits.
  float alpha = tau < 0.01 ? tau * (1.0 - tau * (0.5 - tau * (1.0 / 6.0))) : 1.0 - exp(-tau);
  float weight = transmitted * alpha;
  if (waiting < max(0.5 * uOpacityStep, weight) || middleCell < 0) {
    middleCell = cell;
    middleFraction = f;
  }
  waiting += weight;
  transmitted *= exp(-tau);
  if (waiting >= uOpacityStep) {
    sum += waiting * Shade(middleCell, middleFraction, waiting);
    waiting = 0.0;
    middleCell = -1;
  }
}

void March(vec3 eye, vec3 direction) {
  vec3 scale = 0.5 * vec3(uVoxels) / uRadius;
  vec3 o = eye * scale + 0.5 * vec3(uVoxels) - 0.5 - uCenter * scale, d = direction * scale;
  float perWorld = length(d);
  if (!(perWorld > 0.0)) return;
  d /= perWorld;
  float begin = max(uNear * perWorld, 0.0), end = 3.4e38;
  for (int a = 0; a < 3; ++a) {
    float low = -0.5, high = float(uVoxels[a]) - 0.5;
    if (d[a] == 0.0) {
      if (!(o[a] >= low && o[a] < high)) return;
      continue;
    }
    float t0 = (low - o[a]) / d[a], t1 = (high - o[a]) / d[a];
    begin = max(begin, min(t0, t1));
    end = min(end, max(t0, t1) * (1.0 + 3.582e-7));
  }
  if (!(end > begin)) return;
  int steps = int(min(ceil((end - begin) / uStep), 1048576.0));
  vec3 top = vec3(uVoxels - 1);
  float delta = uStep / (perWorld * uUnit);
  for (int i = 0, guard = 0; i < steps && guard < 16384; ++guard) {
    vec3 p = clamp(o + d * (begin + float(i) * uStep), vec3(0.0), top);
    ivec3 base = min(ivec3(p), uVoxels - 2);
    int width;
    uvec4 cell = TexelAt(base, width);
    if (cell.x >> 31 == 0u) {
      vec3 f = p - vec3(base);
      Composite(int(cell.x), f, DensityIn(cell, f), delta);
      if (Ended()) return;
      ++i;
      continue;
    }
    // To the last sample before the empty cube's end; cubes at the box's faces have none there.
    ivec3 low = base & ~(width - 1);
    float leave = 3.4e38;
    for (int a = 0; a < 3; ++a) {
      if (d[a] == 0.0) continue;
      int face = d[a] > 0.0 ? low[a] + width : low[a];
      if (face > 0 && face < uVoxels[a] - 1) leave = min(leave, (float(face) - o[a]) / d[a]);
    }
    if (leave > end) return;
    i = max(i + 1, int(floor((leave - begin) / uStep)));
  }
}

#if SPHERES
vec3 LayerColor(uvec4 texel, float w, int set) {
  vec3 c = Codes(texel.x).xyz;
  return w * c * vec3(uTexelScale[3 * set], uTexelScale[3 * set + 1], uTexelScale[3 * set + 2]);
}

void CompositeSpheres(vec3 eye, vec3 direction) {
  vec3 o = (eye - uCenter) / uRadius, d = direction / uRadius;
  float perWorld = length(d);
  if (!(perWorld > 0.0)) return;
  d /= perWorld;
  float along = dot(o, d);
  vec3 nearest = o - d * along;
  float rest = dot(nearest, d);
  nearest -= d * rest;
  along += rest;
  for (int i = 0; i < uLayers; ++i) {
    if (Ended()) return;
    float u = 1.0 - (float(i) + 0.5) / float(uLayers);
    float squared = dot(nearest, nearest) * u * u;
    if (!(squared < 1.0)) continue;
    float root = sqrt(1.0 - squared);
    if (!(root - along * u > 0.0)) continue;
    vec3 place = nearest * u + d * root;
    float x = float(uResolution) * (1.0 + atan(place.x, place.z) * 0.318309886183790672);
    float y = float(uResolution) * (0.5 - atan(place.y, length(place.xz)) * 0.318309886183790672);
    ivec2 low = clamp(ivec2(x, y), ivec2(0), ivec2(2 * uResolution - 1, uResolution - 1));
    vec2 f = vec2(x, y) - vec2(low);
    vec3 raw = vec3(0.0);
    float density = 0.0;
    for (int k = 0; k < 4; ++k) {
      ivec2 at = ivec2((low.x + (k >> 1)) % (2 * uResolution), min(low.y + (k & 1), uResolution - 1));
      int column = texelFetch(uColumn, At(at.x * uResolution + at.y), 0).x;
      if (column < 0) continue;
      float w = (k >> 1 == 1 ? f.x : 1.0 - f.x) * ((k & 1) == 1 ? f.y : 1.0 - f.y);
      int texel = column * uLayers + i;
      uvec4 own = texelFetch(uTexel0, At(texel), 0);
      density += w * unpackHalf2x16(own.y).x;
      if (uWeight.x > 0.0) raw += uWeight.x * LayerColor(own, w, 0);
      if (uWeight.y > 0.0) raw += uWeight.y * LayerColor(texelFetch(uTexel1, At(texel), 0), w, 1);
      if (uWeight.z > 0.0) raw += uWeight.z * LayerColor(texelFetch(uTexel2, At(texel), 0), w, 2);
    }
    float tau = min(max(density, 0.0) / (float(uLayers) * perWorld), 104.0);
    if (!(tau > 0.0)) continue;
    float alpha = tau < 0.01 ? tau * (1.0 - tau * (0.5 - tau * (1.0 / 6.0))) : 1.0 - exp(-tau);
    vec3 raised = uMap * (0.5 + 0.28209479177387814 * raw) + uOffset;
    sum += transmitted * alpha * max(raised, 0.0);
    transmitted *= exp(-tau);
  }
}

#endif

void main() {
  // Rows count from the top, as in pictures.
  vec2 pixel = vec2(gl_FragCoord.x, uSize.y - gl_FragCoord.y);
  vec3 eye = uEye;
  vec3 d = normalize(uWorldFromCamera * vec3((pixel - uLens.zw) / uLens.xy, 1.0));
  if (uNdc.x > 0.0) {
    if (d.z > 1e-6) {
      vec2 on = eye.xy + (1.0 - eye.z) / d.z * d.xy;
      eye = vec3(uNdc * on, -1.0);
      d = normalize(vec3(uNdc * (d.xy / d.z - on), 2.0));
    } else {
      d = vec3(0.0);
    }
  }
  float g[9];
  Harmonics(d, g);
  Scaled(g, 0, s0);
#if SETS > 1
  if (uWeight.y > 0.0) Scaled(g, 1, s1);
  if (uWeight.z > 0.0) Scaled(g, 2, s2);
#endif
  if (dot(d, d) > 0.0) {
    March(eye, d);
    if (middleCell >= 0) {
      // What would still come through a ray that has ended takes its last colour.
      if (Ended()) {
        waiting += transmitted;
        transmitted = 0.0;
      }
      sum += waiting * Shade(middleCell, middleFraction, waiting);
    }
#if SPHERES
    if (transmitted >= kStop) CompositeSpheres(eye, d);
#endif
  }
  color = vec4(clamp(sum + transmitted * uBackground, 0.0, 1.0), 1.0);
}
