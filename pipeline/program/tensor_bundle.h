// Reads TensorFlow's checkpoints ("tensor bundles"): weights by name.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace regrade {

struct BundleTensor {
  std::vector<int64_t> shape;
  std::vector<float> values;  // row-major
};
using TensorBundle = std::map<std::string, BundleTensor>;

inline constexpr uint64_t kMostBundleBytes = 64 << 20;

// The tensors of 32-bit floats in a bundle of one shard; others are left out. `index` is the
// file NAME.index, a table of LevelDB's format (blocks of keys with shared beginnings, a
// CRC-32C each) whose values are messages BundleEntryProto of tensorflow/core/protobuf/
// tensor_bundle.proto; `data` is NAME.data-00000-of-00001. Throws Error(kInput) naming `where`
// for anything that is damaged, compressed, sliced, of the other byte order, or of another
// version. Memory is bounded by that of the files: tensors may not overlap.
TensorBundle ReadTensorBundle(std::string_view index, std::string_view data,
                              const std::string& where);

// The checksum of both formats: CRC-32C, rotated and shifted as LevelDB stores it.
uint32_t MaskedCrc32c(std::string_view bytes);

}  // namespace regrade
