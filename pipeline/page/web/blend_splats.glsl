#version 300 es
// A parallelogram around each splat's ellipse, back to front; see EQ(splat-opacity) and EQ(splat-composite) in the C++ headers
// of kernels/splats. The first part is the vertex shader, the second one the fragment shader.
precision highp float;
precision highp int;
precision highp isampler2D;
precision highp usampler2D;

uniform isampler2D uOrder;
uniform int uCount, uMost;            // splats in the order; those from uMost on are left out
uniform usampler2D uPlace, uLight;  // see see_splats.glsl
uniform vec2 uSize;
uniform vec4 uStrip;                // what is drawn: left, right, top and bottom, pixels
flat out vec4 ellipse;              // u, v, c10, 1 / c00
flat out vec2 end;                  // 1 / c11, ln(o rho)
flat out vec3 light;

const float kLogMinAlpha = -5.541263545158426;

void main() {
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  int i = gl_InstanceID * 1024 + (gl_VertexID >> 2);  // quads of an instance: see splats.js
  if (i >= uCount) return;
  int splat = texelFetch(uOrder, ivec2(i & 2047, i >> 11), 0).x;
  if (splat >= uMost) return;
  ivec2 at = ivec2(splat & 2047, splat >> 11);
  uvec4 a = texelFetch(uLight, at, 0);
  float logOpacity = uintBitsToFloat(a.y);
  if (!(logOpacity >= kLogMinAlpha)) return;
  vec4 e = uintBitsToFloat(texelFetch(uPlace, at, 0));
  float c11 = uintBitsToFloat(a.x), reach = sqrt(2.0 * (logOpacity - kLogMinAlpha)) + 1e-4;
  vec2 half_ = reach * vec2(e.z, length(vec2(e.w, c11)));
  if (e.x + half_.x < uStrip.x || e.x - half_.x > uStrip.y || e.y + half_.y < uStrip.z || e.y - half_.y > uStrip.w) return;
  vec2 corner = reach * vec2((gl_VertexID & 1) * 2 - 1, (gl_VertexID & 2) - 1);
  vec2 pixel = e.xy + vec2(e.z * corner.x, e.w * corner.x + c11 * corner.y);
  gl_Position = vec4(vec2(2.0, -2.0) * pixel / uSize + vec2(-1.0, 1.0), 0.0, 1.0);
  ellipse = vec4(e.xy, e.w, 1.0 / e.z);
  end = vec2(1.0 / c11, logOpacity);
  light = vec3(unpackHalf2x16(a.z), unpackHalf2x16(a.w).x);
}
//@fragment
#version 300 es
precision highp float;
uniform vec2 uSize;
flat in vec4 ellipse;
flat in vec2 end;
flat in vec3 light;
out vec4 color;

void main() {
  vec2 d = vec2(gl_FragCoord.x, uSize.y - gl_FragCoord.y) - ellipse.xy;
  float x = d.x * ellipse.w, y = (d.y - ellipse.z * x) * end.x;
  float logAlpha = end.y - 0.5 * (x * x + y * y);
  if (!(logAlpha >= -5.541263545158426)) discard;
  float alpha = min(0.99, exp(logAlpha));
  color = vec4(light * alpha, alpha);
}
