// The colours of records in a direction, of up to SETS mixed; see color_code.js.
uniform mat3 uOpponent[SETS];
uniform vec3 uHarmonics[27 * SETS], uStepOf[9 * SETS];
uniform ivec4 uBits[7 * SETS];
uniform vec3 uWeight;
uniform mat3 uMap;
uniform vec3 uOffset;
//@code

void Harmonics(vec3 d, out float g[9]) {
  g[0] = 0.28209479177387814;
  g[1] = -0.4886025119029199 * d.y;
  g[2] = 0.4886025119029199 * d.z;
  g[3] = -0.4886025119029199 * d.x;
  g[4] = 1.0925484305920792 * d.x * d.y;
  g[5] = -1.0925484305920792 * d.y * d.z;
  g[6] = 0.31539156525252005 * (2.0 * d.z * d.z - d.x * d.x - d.y * d.y);
  g[7] = -1.0925484305920792 * d.x * d.z;
  g[8] = 0.5462742152960396 * (d.x * d.x - d.y * d.y);
}

// The steps times the turned harmonics.
void Scaled(float g[9], int set, out vec3 s[9]) {
  vec3 a = vec3(g[0], g[1], g[2]), b = vec3(g[3], g[4], g[5]), c = vec3(g[6], g[7], g[8]);
  for (int j = 0; j < 9; ++j) {
    int at = 27 * set + 3 * j;
    s[j] = uStepOf[9 * set + j] * (dot(uHarmonics[at], a) + dot(uHarmonics[at + 1], b) + dot(uHarmonics[at + 2], c));
  }
}

// The products of a record's numbers with s.
vec3 ColorOf(uvec4 words, int set, vec3 s[9]) {
  vec3 q[9], sum = vec3(0.0);
  Unpack(words, set, q);
  for (int j = 0; j < 9; ++j) sum += q[j] * s[j];
  return sum;
}
