// Fuzz target: TensorFlow's checkpoints.
#include <algorithm>
#include <cstring>

#include "pipeline/program/tensor_bundle.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/mutate.h"

namespace regrade::testing {
namespace {

constexpr size_t kFooter = 48, kHandle = 4;

// What the tensors are in.
const std::string& Data() {
  static const std::string data = [] {
    std::string bytes;
    for (int i = 0; i < 64; ++i) bytes += static_cast<char>(i * 7);
    return bytes;
  }();
  return data;
}

std::string Varint(uint64_t value) {
  std::string bytes;
  for (; value >= 128; value >>= 7) bytes += static_cast<char>(value % 128 + 128);
  return bytes + static_cast<char>(value);
}

std::string Word(uint32_t value) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

std::string Entry(const std::string& key, const std::string& value, size_t shared = 0) {
  return Varint(shared) + Varint(key.size() - shared) + Varint(value.size()) +
         key.substr(shared) + value;
}

// A tensor's record.
std::string Tensor(const std::vector<uint64_t>& shape, uint64_t offset, uint64_t size) {
  std::string sides;
  for (const uint64_t side : shape) {
    const std::string dimension = "\x08" + Varint(side);
    sides += "\x12" + Varint(dimension.size()) + dimension;
  }
  const std::string_view bytes =
      offset <= Data().size() ? std::string_view(Data()).substr(offset, size) : "";
  return "\x08\x01\x12" + Varint(sides.size()) + sides + "\x20" + Varint(offset) + "\x28" +
         Varint(size) + "\x35" + Word(MaskedCrc32c(bytes));
}

// Two bytes for each number of a handle, so that a handle's place does not move.
std::string Handle(size_t offset, size_t size) {
  const auto wide = [](size_t v) {
    return std::string{static_cast<char>(v % 128 + 128), static_cast<char>(v / 128)};
  };
  return wide(offset) + wide(size);
}

// The file around a block of entries.
std::string File(const std::string& entries) {
  const auto sealed = [](std::string block) {
    block += Word(0) + Word(1) + '\0';
    return block + Word(MaskedCrc32c(block));
  };
  const std::string block = sealed(entries);
  const std::string table = sealed(Entry("z", Handle(0, block.size() - 5)));
  std::string footer = Handle(0, 0) + Handle(block.size(), table.size() - 5);
  footer.resize(kFooter - 8);
  return block + table + footer + std::string("\x57\xfb\x80\x8b\x24\x75\x47\xdb", 8);
}

// The entries of a file of the above.
std::string EntriesOf(const std::string& file) {
  if (file.size() < kFooter) return "";
  const char* const at = file.data() + file.size() - kFooter + kHandle;
  const size_t size = static_cast<size_t>(at[0] & 127) + 128 * static_cast<size_t>(at[1] & 127);
  return size < 13 || size > file.size() ? "" : file.substr(0, size - 13);
}

std::string Header() { return Entry("", std::string("\x08\x01\x1a\x02\x08\x01", 6)); }

std::vector<std::string> Seeds() {
  return {File(Header()), File(Header() + Entry("a/bias", Tensor({4}, 0, 16)) +
                               Entry("a/kernel", Tensor({3, 2}, 16, 24), 2) +
                               Entry("text", std::string("\x08\x07\x20\x28\x28\x08", 6)))};
}

std::string Mutate(std::string file, FuzzRandom* random) {
  if (random->Chance(0.1)) return MutateBytes(std::move(file), random);
  std::string entries = EntriesOf(file);
  if (random->Chance(0.5)) {
    static constexpr uint64_t kSizes[] = {0, 1, 2, 3, 4, 12, 16, 64, 1ull << 31, ~0ull};
    const auto size = [&] { return kSizes[random->Below(std::size(kSizes))]; };
    const uint64_t sides = random->Below(4);
    std::vector<uint64_t> shape;
    for (uint64_t i = 0; i < sides; ++i) shape.push_back(size());
    entries += Entry("t" + std::to_string(random->Below(100)),
                     Tensor(shape, size(), random->Chance(0.5) ? size() : 4 * size()));
  } else {
    entries = MutateBytes(std::move(entries), random);
  }
  entries.resize(std::min<size_t>(entries.size(), 8000));
  return File(entries);
}

bool Read(std::string_view bytes) {
  return Accepts([bytes] {
    size_t values = 0;
    for (const auto& [name, tensor] : ReadTensorBundle(bytes, Data(), "fuzz.index")) {
      FuzzRequire(!name.empty(), "a tensor has a name");
      int64_t count = 1;
      for (const int64_t side : tensor.shape) count *= side;
      FuzzRequire(count == std::ssize(tensor.values), "a tensor has its shape's size");
      values += tensor.values.size();
    }
    FuzzRequire(values * sizeof(float) <= Data().size(), "tensors are within the file");
  });
}

}  // namespace

std::vector<FuzzTarget> BundleTargets() { return {{"bundle", Seeds, Read, Mutate}}; }

}  // namespace regrade::testing
