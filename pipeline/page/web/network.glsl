#version 300 es
// A style's network on one splat for each pixel: see EQ(liprf-network) in the C++ sources.
precision highp float;
precision highp int;
precision highp usampler2D;

uniform usampler2D uColor;            // a splat's numbers
uniform usampler2D uPlace, uResidual; // of a strip that begins at row uRow: places of splats, and see unpackResidual
uniform int uRow;
uniform mat3 uOpponent[2];            // of the source and the style, see color_code.js
uniform vec3 uHarmonics[54], uStepOf[18];
uniform ivec4 uBits[14];
uniform vec3 uPosition;               // the place's unit
uniform vec3 uConstant;               // of the colour map
uniform mat3 uBase;
uniform float uOmega, uPositionScale, uShift;
uniform vec3 uResidualScale;
uniform int uHasResidual, uActivation;
layout(std140) uniform Layer0 { mat4 w0[128]; };
layout(std140) uniform Layer1 { mat4 w1[256]; };
layout(std140) uniform Layer2 { mat4 w2[256]; };
layout(std140) uniform Layer3 { mat4 w3[256]; };
layout(std140) uniform Layer4 { mat4 w4[256]; };
layout(std140) uniform Layer5 { mat4 w5[112]; };
layout(std140) uniform Biases { vec4 bias[96]; };
out uvec4 color;
//@code

vec4 Activate(vec4 x) {
  if (uActivation == 0) return sin(uOmega * x);
  if (uActivation == 1) return max(x, 0.0);
  if (uActivation == 2) return max(x, 0.01 * x);
  if (uActivation == 3) return 1.0 / (1.0 + exp(-x));
  return tanh(clamp(x, -20.0, 20.0));
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  uvec4 own = texelFetch(uColor, at, 0);
  float s[32];
  for (int i = 0; i < 32; ++i) s[i] = 0.0;
  vec3 q[9];
  uvec2 p = texelFetch(uPlace, at - ivec2(0, uRow), 0).xy;
  Unpack(own, 0, q);
  for (int j = 0; j < 9; ++j) {
    vec3 channels = uOpponent[0] * (q[j] * uStepOf[j]);
    for (int k = 0; k < 9; ++k)
      for (int c = 0; c < 3; ++c) s[9 * c + k] += uHarmonics[3 * j + k / 3][k % 3] * channels[c];
  }
  vec3 place = (vec3(p.x & 65535u, p.x >> 16, p.y) + uShift) * uPosition - 1.0;
  for (int i = 0; i < 3; ++i) s[27 + i] = place[i] * uPositionScale;

  vec4 h[16], n[16];
  for (int o = 0; o < 16; ++o) {
    vec4 x = bias[o];
    for (int i = 0; i < 8; ++i) x += w0[8 * o + i] * vec4(s[4 * i], s[4 * i + 1], s[4 * i + 2], s[4 * i + 3]);
    h[o] = Activate(x);
  }
  for (int o = 0; o < 16; ++o) {
    vec4 x = bias[16 + o];
    for (int i = 0; i < 16; ++i) x += w1[16 * o + i] * h[i];
    n[o] = Activate(x);
  }
  for (int o = 0; o < 16; ++o) {
    vec4 x = bias[32 + o];
    for (int i = 0; i < 16; ++i) x += w2[16 * o + i] * n[i];
    h[o] = Activate(x);
  }
  for (int o = 0; o < 16; ++o) {
    vec4 x = bias[48 + o];
    for (int i = 0; i < 16; ++i) x += w3[16 * o + i] * h[i];
    n[o] = Activate(x);
  }
  for (int o = 0; o < 16; ++o) {
    vec4 x = bias[64 + o];
    for (int i = 0; i < 16; ++i) x += w4[16 * o + i] * n[i];
    h[o] = Activate(x);
  }
  float r[28];
  for (int o = 0; o < 7; ++o) {
    vec4 x = bias[80 + o];
    for (int i = 0; i < 16; ++i) x += w5[16 * o + i] * h[i];
    for (int k = 0; k < 4; ++k) r[4 * o + k] = x[k];
  }
  for (int k = 0; k < 9; ++k) {
    vec3 mapped = uBase * vec3(s[k], s[9 + k], s[18 + k]);
    if (k == 0) mapped += uConstant;
    for (int c = 0; c < 3; ++c) r[9 * c + k] += mapped[c];
  }
  if (uHasResidual == 1) {  // see EQ(view-scale) and EQ(style-mix)
    uvec2 added = texelFetch(uResidual, at - ivec2(0, uRow), 0).xy;
    float weight = float(added.x >> 24) / 255.0;
    for (int c = 0; c < 3; ++c) {
      r[9 * c] += (float(added.x >> (8 * c) & 255u) - 128.0) * uResidualScale[c];
      for (int k = 1; k < 9; ++k) r[9 * c + k] *= float(added.y >> (8 * c) & 255u) / 255.0;
    }
    for (int i = 0; i < 27; ++i) r[i] = mix(s[i], r[i], weight);
  }
  for (int j = 0; j < 9; ++j) {
    vec3 channels = vec3(0.0);
    for (int k = 0; k < 9; ++k) channels += uHarmonics[27 + 3 * j + k / 3][k % 3] * vec3(r[k], r[9 + k], r[18 + k]);
    q[j] = channels * uOpponent[1] / uStepOf[9 + j];
  }
  color = Pack(q, 1);
}
