#include "pipeline/program/tensor_bundle.h"

#include <algorithm>
#include <boost/crc.hpp>
#include <cstring>
#include <utility>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr uint64_t kTableMagic = 0xdb4775248b80fb57u;
constexpr size_t kFooter = 48, kTrailer = 5;  // a type and a checksum end each block
constexpr size_t kMostEntries = 4096, kMostRank = 8, kMostName = 1024;
constexpr uint64_t kMostIndexBytes = 1 << 20;
constexpr uint64_t kFloat = 1;  // DT_FLOAT

struct Handle {
  uint64_t offset = 0, size = 0;
};

class Reader {
 public:
  Reader(std::string_view bytes, const std::string& where) : left_(bytes), where_(where) {}

  [[noreturn]] void Fail(const std::string& what) const {
    throw InputError(what, where_, "copy the checkpoint's files again");
  }
  bool AtEnd() const { return left_.empty(); }
  std::string_view Take(uint64_t size) {
    if (size > left_.size()) Fail("the checkpoint ends too early");
    const std::string_view taken = left_.substr(0, size);
    left_.remove_prefix(size);
    return taken;
  }
  uint64_t Varint() {
    uint64_t value = 0;
    for (int shift = 0; shift < 64; shift += 7) {
      const uint64_t byte = static_cast<unsigned char>(Take(1)[0]);
      value |= (byte & 127) << shift;
      if (byte < 128) return value;
    }
    Fail("a number of the checkpoint is too long");
  }
  template <typename T>
  T Fixed() {
    T value;  // the machine is little-endian, as the file
    std::memcpy(&value, Take(sizeof value).data(), sizeof value);
    return value;
  }
  Handle BlockHandle() {
    Handle handle;
    handle.offset = Varint();
    handle.size = Varint();
    return handle;
  }

 private:
  std::string_view left_;
  const std::string& where_;
};

// Calls `take(key, value)` for each entry of the block, in the order of keys.
template <typename Take>
void ReadBlock(std::string_view file, const Handle& handle, const std::string& where,
               const Take& take) {
  Reader whole(file, where);
  if (handle.offset > file.size()) whole.Fail("a block lies outside of the checkpoint");
  whole.Take(handle.offset);
  const std::string_view block = whole.Take(handle.size);
  const std::string_view type = whole.Take(1);
  if (type[0] != 0) whole.Fail("the checkpoint's index is compressed");
  if (MaskedCrc32c(file.substr(handle.offset, handle.size + 1)) != whole.Fixed<uint32_t>())
    whole.Fail("a block of the checkpoint has another checksum");
  if (block.size() < sizeof(uint32_t)) whole.Fail("a block of the checkpoint is too short");
  uint32_t restarts;
  std::memcpy(&restarts, block.data() + block.size() - sizeof restarts, sizeof restarts);
  if (restarts > block.size() / sizeof restarts - 1)
    whole.Fail("a block of the checkpoint is too short");
  Reader entries(block.substr(0, block.size() - (restarts + size_t{1}) * sizeof restarts),
                 where);
  std::string key;
  for (size_t i = 0; !entries.AtEnd(); ++i) {
    if (i >= kMostEntries) entries.Fail("the checkpoint has too many tensors");
    const uint64_t shared = entries.Varint(), added = entries.Varint(), size = entries.Varint();
    if (shared > key.size()) entries.Fail("a name of the checkpoint is damaged");
    std::string next = key.substr(0, shared);
    next += entries.Take(added);
    if (next.size() > kMostName) entries.Fail("a name of the checkpoint is too long");
    if (i > 0 && next <= key) entries.Fail("the names of the checkpoint are out of order");
    key = std::move(next);
    take(key, entries.Take(size));
  }
}

// Calls `take(field, number, bytes)` for each field of a message: `bytes` where it has some.
template <typename Take>
void ReadMessage(std::string_view message, const std::string& where, const Take& take) {
  Reader reader(message, where);
  while (!reader.AtEnd()) {
    const uint64_t tag = reader.Varint();
    switch (tag & 7) {
      case 0:
        take(tag >> 3, reader.Varint(), std::string_view());
        break;
      case 1:
        take(tag >> 3, reader.Fixed<uint64_t>(), std::string_view());
        break;
      case 2: {
        const uint64_t size = reader.Varint();
        take(tag >> 3, 0, reader.Take(size));
        break;
      }
      case 5:
        take(tag >> 3, reader.Fixed<uint32_t>(), std::string_view());
        break;
      default:
        reader.Fail("a field of the checkpoint is damaged");
    }
  }
}

struct Entry {
  uint64_t type = 0, shard = 0, offset = 0, size = 0, checksum = 0;
  std::vector<int64_t> shape;
};

Entry ReadEntry(std::string_view message, const std::string& where) {
  Entry entry;
  const Reader complain({}, where);
  const auto dimension = [&](uint64_t field, uint64_t, std::string_view bytes) {
    if (field != 2) return;
    int64_t side = 0;
    ReadMessage(bytes, where, [&](uint64_t f, uint64_t number, std::string_view) {
      if (f == 1) side = static_cast<int64_t>(std::min<uint64_t>(number, kMostBundleBytes));
    });
    if (entry.shape.size() >= kMostRank) complain.Fail("a tensor has too many dimensions");
    entry.shape.push_back(side);
  };
  ReadMessage(message, where, [&](uint64_t field, uint64_t number, std::string_view bytes) {
    if (field == 1) entry.type = number;
    if (field == 2) ReadMessage(bytes, where, dimension);
    if (field == 3) entry.shard = number;
    if (field == 4) entry.offset = number;
    if (field == 5) entry.size = number;
    if (field == 6) entry.checksum = number;
    if (field == 7) complain.Fail("a tensor of the checkpoint is in slices");
  });
  return entry;
}

// The empty name's value.
void CheckHeader(std::string_view message, const std::string& where) {
  uint64_t shards = 0, byte_order = 0;
  ReadMessage(message, where, [&](uint64_t field, uint64_t number, std::string_view) {
    if (field == 1) shards = number;
    if (field == 2) byte_order = number;
  });
  if (shards != 1 || byte_order != 0)
    Reader({}, where).Fail("the checkpoint has several files, or another byte order");
}

BundleTensor ReadTensor(const Entry& entry, std::string_view data, const std::string& where) {
  const Reader complain({}, where);
  if (entry.shard != 0 || entry.offset > data.size() || entry.size > data.size() - entry.offset)
    complain.Fail("a tensor lies outside of the checkpoint");
  uint64_t count = 1;
  for (const int64_t side : entry.shape) {
    if (side <= 0 || static_cast<uint64_t>(side) > kMostBundleBytes / count)
      complain.Fail("a tensor has another size than its shape");
    count *= static_cast<uint64_t>(side);
  }
  if (count * sizeof(float) != entry.size)
    complain.Fail("a tensor has another size than its shape");
  const std::string_view bytes = data.substr(entry.offset, entry.size);
  if (MaskedCrc32c(bytes) != entry.checksum)
    complain.Fail("a tensor of the checkpoint has another checksum");
  BundleTensor tensor{entry.shape, std::vector<float>(count)};
  std::memcpy(tensor.values.data(), bytes.data(), bytes.size());
  return tensor;
}

}  // namespace

uint32_t MaskedCrc32c(std::string_view bytes) {
  boost::crc_optimal<32, 0x1EDC6F41, 0xFFFFFFFF, 0xFFFFFFFF, true, true> crc;
  crc.process_bytes(bytes.data(), bytes.size());
  const uint32_t sum = crc.checksum();
  return ((sum >> 15) | (sum << 17)) + 0xa282ead8u;
}

TensorBundle ReadTensorBundle(std::string_view index, std::string_view data,
                              const std::string& where) {
  Reader footer(index, where);
  if (index.size() < kFooter + kTrailer || index.size() > kMostIndexBytes ||
      data.size() > kMostBundleBytes)
    footer.Fail("is no checkpoint's index, or too large");
  footer.Take(index.size() - kFooter);
  footer.BlockHandle();  // of statistics, which are not needed
  const Handle table = footer.BlockHandle();
  uint64_t magic;
  std::memcpy(&magic, index.data() + index.size() - sizeof magic, sizeof magic);
  if (magic != kTableMagic) footer.Fail("is no checkpoint's index");

  TensorBundle bundle;
  bool has_header = false;
  uint64_t taken = 0;
  size_t entries = 0;
  ReadBlock(index, table, where, [&](const std::string&, std::string_view value) {
    ReadBlock(index, Reader(value, where).BlockHandle(), where,
              [&](const std::string& name, std::string_view message) {
                if (++entries > kMostEntries)
                  footer.Fail("the checkpoint has too many tensors");
                if (name.empty()) {
                  CheckHeader(message, where);
                  has_header = true;
                  return;
                }
                const Entry entry = ReadEntry(message, where);
                if (entry.type != kFloat) return;
                BundleTensor tensor = ReadTensor(entry, data, where);
                taken += entry.size;
                if (taken > data.size()) footer.Fail("tensors of the checkpoint overlap");
                bundle[name] = std::move(tensor);
              });
  });
  if (!has_header) footer.Fail("is no checkpoint's index");
  return bundle;
}

}  // namespace regrade
