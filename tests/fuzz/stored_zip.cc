// A subset of the format: APPNOTE.TXT 6.3.9, sections 4.3.7, 4.3.12, 4.3.16.
#include "tests/fuzz/stored_zip.h"

#include <zlib.h>

#include "pipeline/files/npz_file.h"
#include "tests/fuzz/mutate.h"

namespace regrade::testing {
namespace {

std::string Little(uint64_t value, int width) {
  std::string text;
  for (; width-- > 0; value >>= 8) text += static_cast<char>(value & 255);
  return text;
}

uint64_t ValueAt(const std::string& bytes, size_t at, size_t width) {
  uint64_t value = 0;
  for (size_t i = width; i-- > 0;)
    value =
        value << 8 | (at + i < bytes.size() ? static_cast<unsigned char>(bytes[at + i]) : 0);
  return value;
}

}  // namespace

std::string BuildStoredZip(const std::vector<ZipPart>& parts) {
  std::string bytes, directory;
  for (const ZipPart& part : parts) {
    const uint64_t crc = crc32(0, reinterpret_cast<const Bytef*>(part.bytes.data()),
                               static_cast<uInt>(part.bytes.size()));
    const std::string shared = Little(10, 2) + Little(0, 2) + Little(0, 2) + Little(0, 2) +
                               Little(33, 2) + Little(crc, 4) + Little(part.bytes.size(), 4) +
                               Little(part.bytes.size(), 4) + Little(part.name.size(), 2) +
                               Little(0, 2);
    directory += "PK\1\2" + Little(20, 2) + shared + Little(0, 2) + Little(0, 2) +
                 Little(0, 2) + Little(0, 4) + Little(bytes.size(), 4) + part.name;
    bytes += "PK\3\4" + shared + part.name + part.bytes;
  }
  const std::string end = "PK\5\6" + Little(0, 4) + Little(parts.size(), 2) +
                          Little(parts.size(), 2) + Little(directory.size(), 4) +
                          Little(bytes.size(), 4) + Little(0, 2);
  return bytes + directory + end;
}

std::optional<std::vector<ZipPart>> TakeStoredZip(const std::string& bytes) {
  std::vector<ZipPart> parts;
  size_t at = 0;
  while (bytes.compare(at, 4, "PK\3\4") == 0) {
    const size_t size = ValueAt(bytes, at + 18, 4), name = ValueAt(bytes, at + 26, 2),
                 extra = ValueAt(bytes, at + 28, 2), data = at + 30 + name + extra;
    if (ValueAt(bytes, at + 8, 2) != 0 || data + size > bytes.size()) return std::nullopt;
    parts.push_back({bytes.substr(at + 30, name), bytes.substr(data, size)});
    at = data + size;
  }
  if (parts.empty() || bytes.compare(at, 4, "PK\1\2") != 0) return std::nullopt;
  return parts;
}

std::string StoredCopyOfNpz(const std::string& path) {
  NpzReader reader(path, 64 << 20);
  std::vector<ZipPart> parts;
  for (const std::string& name : reader.names()) {
    const NpzArray array = reader.Read(name);
    parts.push_back({name + ".npy", MakeNpyHeader(array.type, array.shape) +
                                        std::string(array.As<char>(),
                                                    static_cast<size_t>(array.bytes.size()))});
  }
  return BuildStoredZip(parts);
}

std::string MutateNpy(std::string bytes, FuzzRandom* random) {
  static const std::vector<std::string> kWords = {"'descr': ",  "'fortran_order': ",
                                                  "'shape': ",  "True",
                                                  "False",      "'<f4'",
                                                  "'|O'",       "'<f2'",
                                                  "'<i8'",      "(",
                                                  ")",          ",",
                                                  "L",          "(3, 4)",
                                                  "{",          "}",
                                                  "4294967296", "'>f4'",
                                                  "'<f8'"};
  const size_t newline = bytes.find('\n');
  if (bytes.size() < 10 || newline == std::string::npos || newline < 10)
    return MutateBytes(std::move(bytes), random);
  std::string text = bytes.substr(10, newline + 1 - 10), data = bytes.substr(newline + 1);
  if (random->Chance(0.5))
    text = MutateText(std::move(text), kWords, random);
  else
    data = MutateBytes(std::move(data), random);
  if (random->Chance(0.1)) bytes[random->Below(10)] ^= 1;
  const size_t length = random->Chance(0.95) ? text.size() : random->Below(70000);
  return bytes.substr(0, 8) + Little(length, 2) + text + data;
}

std::string MutateNpz(std::string bytes, FuzzRandom* random) {
  auto parts = TakeStoredZip(bytes);
  if (!parts || random->Chance(0.15)) return MutateBytes(std::move(bytes), random);
  ZipPart& part = (*parts)[random->Below(parts->size())];
  const ZipPart& other = (*parts)[random->Below(parts->size())];
  switch (random->Below(8)) {
    case 0:
      part.bytes = other.bytes;
      break;
    case 1:
      part.name = other.name;
      break;
    case 2:
      parts->erase(parts->begin() + (&part - parts->data()));
      break;
    case 3:
      parts->push_back({"more.npy", other.bytes});
      break;
    default:
      part.bytes = MutateNpy(std::move(part.bytes), random);
  }
  bytes = BuildStoredZip(*parts);
  return random->Chance(0.1) ? MutateBytes(std::move(bytes), random) : bytes;
}

}  // namespace regrade::testing
