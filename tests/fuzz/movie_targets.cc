// The atoms of an MP4 file, whose index is moved to its front.
#include "pipeline/images/mp4_faststart.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/mutate.h"

namespace regrade::testing {
namespace {

std::string Big(uint64_t value, int bytes) {
  std::string text;
  for (int i = bytes - 1; i >= 0; --i) text += static_cast<char>(value >> (8 * i) & 255);
  return text;
}

std::string Atom(const std::string& type, const std::string& body) {
  return Big(body.size() + 8, 4) + type + body;
}

std::string Movie(int width, bool index_first) {
  const std::string ftyp = Atom("ftyp", "isom0000"), data = Atom("mdat", "frames!");
  const std::string table =
      Atom(width == 4 ? "stco" : "co64", Big(0, 4) + Big(1, 4) + Big(ftyp.size() + 10, width));
  const std::string index =
      Atom("moov",
           Atom("trak", Atom("mdia", Atom("minf", Atom("stbl", table)))) + Atom("udta", "x"));
  return index_first ? ftyp + index + data : ftyp + data + index;
}

std::vector<std::string> Seeds() { return {Movie(4, false), Movie(8, false), Movie(4, true)}; }

bool Read(std::string_view bytes) {
  const std::vector<char> own(bytes.begin(), bytes.end());
  const std::string_view file(own.data(), own.size());
  return Accepts([file] {
    const std::string moved = MoveIndexFirst(file);
    FuzzRequire(moved.size() == file.size(), "no byte more or less");
    const std::vector<Mp4Atom> atoms = ListMp4Atoms(moved);
    FuzzRequire(atoms.size() >= 2 && atoms[1].type == "moov", "the index is behind ftyp");
    FuzzRequire(MoveIndexFirst(moved) == moved, "once is enough");
  });
}

std::string Mutate(std::string bytes, FuzzRandom* random) {
  // A size that is right for once: to the file's end, or of an atom with 64 bits.
  if (bytes.size() > 16 && random->Chance(0.1)) {
    const size_t at = random->Below(bytes.size() - 8);
    bytes.replace(at, 4, Big(random->Chance(0.5) ? 1 : bytes.size() - at, 4));
  }
  return MutateBytes(std::move(bytes), random);
}

}  // namespace

std::vector<FuzzTarget> MovieTargets() {
  return {{"mp4_faststart", Seeds, Read, Mutate, 50000}};
}

}  // namespace regrade::testing
