// The 27 numbers of a splat's colours in four words, see pipeline/page/color_code.h; the same as text for shaders.

const CODE_WORDS = [[0, 11, 4, 21, 14, 24, 17], [1, 18, 19, 6, 7, 16, 25], [9, 3, 12, 13, 22, 23, 26], [2, 10, 5, 20, 15, 8]];

// Of number 9 a + j: its word, the bits above it and the bits below it in 32.
function placesOfNumbers(bits) {
  const places = [];
  CODE_WORDS.forEach((numbers, word) => {
    let above = 0;
    for (const number of numbers) {
      places[number] = {word, above, unused: 32 - bits[number]};
      above += bits[number];
    }
  });
  return places;
}

function checkCode(code, id) {
  const sized = (list, n) => Array.isArray(list) && list.length === n && list.every(Number.isFinite);
  if (!code || !sized(code.opponent, 9) || !sized(code.harmonics, 81) || !sized(code.step, 27) || !sized(code.bits, 27) ||
      !code.bits.every((b) => b >= 1 && b <= 12) || !CODE_WORDS.every((w) => w.reduce((sum, k) => sum + code.bits[k], 0) <= 32))
    throw damaged(id);
  return code;
}

// GLSL: q[j][a] from and to words. `uBits` has 28 numbers for each set, in the order of the words.
function codeGlsl() {
  let slot = 0;
  const parts = CODE_WORDS.flatMap((numbers, word) => numbers.map((number) => ({
    q: `q[${number % 9}].${'xyz'[Math.floor(number / 9)]}`, w: 'w.' + 'xyzw'[word], rest: 'rest.' + 'xyzw'[word],
    bits: `uBits[7 * set + ${slot >> 2}].${'xyzw'[slot++ & 3]}`})));
  return `
float Next(inout uint word, int bits) {
  float number = float(int(word) >> (32 - bits));
  word <<= uint(bits);
  return number;
}
void Unpack(uvec4 w, int set, out vec3 q[9]) {
${parts.map((p) => `  ${p.q} = Next(${p.w}, ${p.bits});`).join('\n')}
}
void Put(inout uint word, inout int rest, float number, int bits) {
  float most = float((1 << (bits - 1)) - 1);
  rest -= bits;
  word |= (uint(int(clamp(floor(number + 0.5), -most, most))) & ((1u << uint(bits)) - 1u)) << uint(rest);
}
uvec4 Pack(vec3 q[9], int set) {
  uvec4 w = uvec4(0u);
  ivec4 rest = ivec4(32);
${parts.map((p) => `  Put(${p.w}, ${p.rest}, ${p.q}, ${p.bits});`).join('\n')}
  return w;
}
`;
}

const bitsInOrder = (code) => [...CODE_WORDS.flat().map((number) => code.bits[number]), 1];
// [9 harmonics, 3 channels], as shaders have them.
const stepsInOrder = (code) => code.step.map((_, i) => code.step[9 * (i % 3) + Math.floor(i / 3)]);
