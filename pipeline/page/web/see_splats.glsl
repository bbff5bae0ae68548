#version 300 es
// A splat for each pixel, as a camera sees it: its ellipse and its colour; see the C++ headers kernels/splats/projection.h,
// extent.h and splat_color.h.
precision highp float;
precision highp int;
precision highp usampler2D;

uniform usampler2D uMean, uShape;  // see decode.js
uniform usampler2D uColor0, uColor1, uColor2;
//@colors
uniform mat3 uWorldFromCamera;
uniform vec3 uEye;
uniform vec4 uLens;  // focal lengths and principal point, pixels
uniform vec2 uSize;
uniform float uNearPlane, uScaleStep, uRotationStep;
uniform vec2 uBlur;  // added, fitted: see EQ(splat-filter)
layout(location = 0) out uvec4 place;  // u, v, c00, c10
layout(location = 1) out uvec4 light;  // c11, ln(o rho), red and green, blue

const float kMaxOffset = 1e7, kMaxSlope = 1.3, kLogMinAlpha = -5.541263545158426;

vec2 Signed(uint word) { return vec2(int(word << 16) >> 16, int(word) >> 16); }

// Columns of the rotation of a unit quaternion (w, n).
mat3 RotationOf(float w, vec3 n) {
  vec3 s = n * n, m = n * n.yzx, v = w * n;  // m: xy, yz, zx
  return mat3(1.0 - 2.0 * (s.y + s.z), 2.0 * (m.x + v.z), 2.0 * (m.z - v.y),
              2.0 * (m.x - v.z), 1.0 - 2.0 * (s.x + s.z), 2.0 * (m.y + v.x),
              2.0 * (m.z + v.y), 2.0 * (m.y - v.x), 1.0 - 2.0 * (s.x + s.y));
}

vec3 ColorAt(ivec2 at, vec3 direction) {
  float g[9];
  vec3 s[9];
  Harmonics(direction, g);
  Scaled(g, 0, s);
  vec3 raw = 0.5 + uWeight.x * (uOpponent[0] * ColorOf(texelFetch(uColor0, at, 0), 0, s));
#if SETS > 1
  if (uWeight.y > 0.0) {
    Scaled(g, 1, s);
    raw += uWeight.y * (uOpponent[1] * ColorOf(texelFetch(uColor1, at, 0), 1, s));
  }
  if (uWeight.z > 0.0) {
    Scaled(g, 2, s);
    raw += uWeight.z * (uOpponent[2] * ColorOf(texelFetch(uColor2, at, 0), 2, s));
  }
#endif
  return max(uMap * raw + uOffset, 0.0);
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  place = uvec4(0u);
  light = uvec4(0u, floatBitsToUint(-100.0), 0u, 0u);
  uvec4 own = texelFetch(uMean, at, 0), shape = texelFetch(uShape, at, 0);
  vec3 from = uintBitsToFloat(own.xyz) - uEye, p = from * uWorldFromCamera;
  if (!(p.z >= uNearPlane)) return;
  vec2 slope = p.xy / p.z, screen = uLens.xy * slope + uLens.zw;
  if (!(max(abs(screen.x), abs(screen.y)) <= kMaxOffset)) return;
  vec2 middle = (0.5 * uSize - uLens.zw) / uLens.xy, most = kMaxSlope * 0.5 * uSize / uLens.xy;
  vec3 t = vec3(clamp(slope, middle - most, middle + most), 1.0);
  vec2 perZ = uLens.xy / p.z, a = Signed(shape.x), b = Signed(shape.y), c = Signed(shape.z);
  vec3 scale = exp(vec3(a, b.x) * uScaleStep), n = vec3(b.y, c) * uRotationStep;
  mat3 axes = transpose(uWorldFromCamera) * RotationOf(sqrt(1.0 - dot(n, n)), n);
  vec3 across = t * axes;  // t.v of each axis
  vec3 a0 = scale * perZ.x * (vec3(axes[0].x, axes[1].x, axes[2].x) - t.x * vec3(axes[0].z, axes[1].z, axes[2].z));
  vec3 a1 = scale * perZ.y * (vec3(axes[0].y, axes[1].y, axes[2].y) - t.y * vec3(axes[0].z, axes[1].z, axes[2].z));
  vec3 area = (scale.yzx * perZ.x) * (scale.zxy * perZ.y) * across;
  float c00 = sqrt(dot(a0, a0) + uBlur.x), c10 = dot(a0, a1) / c00;
  float c11 = sqrt(dot(area / c00, area / c00) + uBlur.x * (1.0 + dot(a1 / c00, a1 / c00)));
  float logOpacity = uintBitsToFloat(own.w);
  if (uBlur.y < uBlur.x)
    logOpacity += log(length(vec2(length(area) / c11, length(vec3(length(a0), length(a1), sqrt(uBlur.y)) / c11) * sqrt(uBlur.y))) / c00);
  if (!(logOpacity >= kLogMinAlpha)) return;
  vec3 color = ColorAt(at, normalize(from));
  place = floatBitsToUint(vec4(screen, c00, c10));
  light = uvec4(floatBitsToUint(vec2(c11, logOpacity)), packHalf2x16(color.xy), packHalf2x16(vec2(color.z, 0.0)));
}
