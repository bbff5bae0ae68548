#include "pipeline/images/mp4_faststart.h"

#include <algorithm>

#include "kernels/base/error.h"

namespace regrade {
namespace {

[[noreturn]] void Refuse(const std::string& why, uint64_t offset) {
  throw Error(ExitCode::kInput,
              "not a plain MP4 file: " + why + " at byte " + std::to_string(offset));
}

uint64_t BigEndian(std::string_view bytes, uint64_t at, int size) {
  uint64_t value = 0;
  for (int i = 0; i < size; ++i) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

void PutBigEndian(uint64_t value, uint64_t at, int size, std::string* bytes) {
  for (int i = size - 1; i >= 0; --i, value >>= 8) (*bytes)[at + i] = static_cast<char>(value);
}

struct Header {
  Mp4Atom atom;
  uint64_t header_size;
};

// The atom at `at`, which must end by `end`.
Header ReadHeader(std::string_view bytes, uint64_t at, uint64_t end) {
  if (end - at < 8) Refuse("half an atom", at);
  Header header{{std::string(bytes.substr(at + 4, 4)), at, BigEndian(bytes, at, 4)}, 8};
  if (header.atom.size == 1) {
    if (end - at < 16) Refuse("half an atom", at);
    header.atom.size = BigEndian(bytes, at + 8, 8);
    header.header_size = 16;
  } else if (header.atom.size == 0) {
    header.atom.size = end - at;  // the rest of the file
  }
  if (header.atom.size < header.header_size || header.atom.size > end - at)
    Refuse("an atom of " + std::to_string(header.atom.size) + " bytes", at);
  return header;
}

// Where each top-level atom goes.
struct Move {
  uint64_t old_begin, size, new_begin;
};

uint64_t Moved(uint64_t offset, const std::vector<Move>& moves, uint64_t at) {
  for (const Move& move : moves)
    if (offset >= move.old_begin && offset - move.old_begin < move.size)
      return offset - move.old_begin + move.new_begin;
  Refuse("a chunk offset outside of the file", at);
}

// Rewrites the table of chunk offsets in [at, end): version and flags, count, offsets.
void MoveOffsets(int width, uint64_t at, uint64_t end, const std::vector<Move>& moves,
                 std::string* moov) {
  if (end - at < 8) Refuse("half a table of chunk offsets", at);
  const uint64_t count = BigEndian(*moov, at + 4, 4);
  if (count > (end - at - 8) / width) Refuse("a table that is longer than its atom", at);
  for (uint64_t i = 0; i < count; ++i) {
    const uint64_t entry = at + 8 + i * width;
    const uint64_t offset = Moved(BigEndian(*moov, entry, width), moves, entry);
    if (width == 4 && offset > 0xffffffffu) Refuse("a chunk offset beyond 4 GiB", entry);
    PutBigEndian(offset, entry, width, moov);
  }
}

// Walks the atoms in [at, end) of moov; the tables lie at moov/trak/mdia/minf/stbl.
void MoveTables(uint64_t at, uint64_t end, int depth, const std::vector<Move>& moves,
                std::string* moov) {
  constexpr int kDepth = 5;
  while (at < end) {
    const Header header = ReadHeader(*moov, at, end);
    const std::string& type = header.atom.type;
    const uint64_t body = at + header.header_size, next = at + header.atom.size;
    if (type == "stco" || type == "co64") {
      MoveOffsets(type == "stco" ? 4 : 8, body, next, moves, moov);
    } else if (depth < kDepth && (type == "moov" || type == "trak" || type == "mdia" ||
                                  type == "minf" || type == "stbl")) {
      MoveTables(body, next, depth + 1, moves, moov);
    }
    at = next;
  }
}

}  // namespace

std::vector<Mp4Atom> ListMp4Atoms(std::string_view file) {
  std::vector<Mp4Atom> atoms;
  for (uint64_t at = 0; at < file.size(); at += atoms.back().size)
    atoms.push_back(ReadHeader(file, at, file.size()).atom);
  return atoms;
}

std::string MoveIndexFirst(std::string_view file) {
  const std::vector<Mp4Atom> atoms = ListMp4Atoms(file);
  const auto find = [&](const char* type) {
    const auto is = [&](const Mp4Atom& atom) { return atom.type == type; };
    if (std::count_if(atoms.begin(), atoms.end(), is) > 1)
      Refuse(std::string("several atoms ") + type, 0);
    return std::find_if(atoms.begin(), atoms.end(), is);
  };
  const auto moov = find("moov");
  if (atoms.empty() || atoms[0].type != "ftyp") Refuse("no ftyp atom", 0);
  if (moov == atoms.end()) Refuse("no index (moov atom)", file.size());
  if (find("moof") != atoms.end()) Refuse("a fragmented file", find("moof")->begin);
  if (moov == atoms.begin() + 1) return std::string(file);

  std::vector<Mp4Atom> order = {atoms[0], *moov};
  for (auto atom = atoms.begin() + 1; atom != atoms.end(); ++atom)
    if (atom != moov) order.push_back(*atom);
  std::vector<Move> moves;
  uint64_t position = 0;
  for (const Mp4Atom& atom : order) {
    moves.push_back({atom.begin, atom.size, position});
    position += atom.size;
  }
  std::string index(file.substr(moov->begin, moov->size));
  MoveTables(0, index.size(), 0, moves, &index);

  std::string result;
  result.reserve(file.size());
  for (const Mp4Atom& atom : order)
    result +=
        atom.type == "moov" ? std::string_view(index) : file.substr(atom.begin, atom.size);
  // "To the end of the file" holds for the last atom only, which may be another one now.
  for (size_t i = 0; i < moves.size(); ++i)
    if (BigEndian(result, moves[i].new_begin, 4) == 0) {
      if (moves[i].size > 0xffffffffu) Refuse("an atom beyond 4 GiB", moves[i].old_begin);
      PutBigEndian(moves[i].size, moves[i].new_begin, 4, &result);
    }
  return result;
}

}  // namespace regrade
