// Reads and writes NumPy's .npz: a zip archive of .npy members.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "kernels/base/buffer.h"
#include "pipeline/files/npy_header.h"

namespace regrade {

template <typename T>
struct ArrayTypeOf;
template <>
struct ArrayTypeOf<uint8_t> : std::integral_constant<ArrayType, ArrayType::kU8> {};
template <>
struct ArrayTypeOf<int32_t> : std::integral_constant<ArrayType, ArrayType::kI32> {};
template <>
struct ArrayTypeOf<int64_t> : std::integral_constant<ArrayType, ArrayType::kI64> {};
template <>
struct ArrayTypeOf<uint64_t> : std::integral_constant<ArrayType, ArrayType::kU64> {};
template <>
struct ArrayTypeOf<uint16_t> : std::integral_constant<ArrayType, ArrayType::kF16> {};
template <>
struct ArrayTypeOf<float> : std::integral_constant<ArrayType, ArrayType::kF32> {};
template <>
struct ArrayTypeOf<double> : std::integral_constant<ArrayType, ArrayType::kF64> {};

enum class NpzPacking { kStore, kDeflate };

// Collects arrays by reference and writes them straight to disk: what `data` points to must
// stay valid until WriteTo. Equal arrays give equal bytes on any day. uint16_t holds the bit
// pattern of a half (half.h).
class NpzWriter {
 public:
  NpzWriter();
  ~NpzWriter();

  template <typename T>
  void Add(const std::string& name, const std::vector<int64_t>& shape, const T* data,
           NpzPacking packing = NpzPacking::kStore) {
    AddBytes(name, ArrayTypeOf<T>::value, shape, data, packing);
  }
  // `fill(first, rows, to)` makes rows [first, first + rows) of the first axis while the file
  // is written: the array never exists as a whole.
  template <typename T>
  void AddFilled(const std::string& name, const std::vector<int64_t>& shape,
                 std::function<void(int64_t first, int64_t rows, T* to)> fill,
                 NpzPacking packing = NpzPacking::kStore) {
    AddRows(
        name, ArrayTypeOf<T>::value, shape,
        [fill = std::move(fill)](int64_t first, int64_t rows, void* to) {
          fill(first, rows, static_cast<T*>(to));
        },
        packing);
  }
  // A copy is kept.
  template <typename T>
  void AddScalar(const std::string& name, T value) {
    AddCopy(name, ArrayTypeOf<T>::value, {}, &value, sizeof value);
  }
  void AddText(const std::string& name, const std::string& text) {
    AddCopy(name, ArrayType::kU8, {std::ssize(text)}, text.data(), text.size());
  }

  // Atomically (see AtomicFile); takes a few megabytes of memory, whatever the arrays' sizes.
  // Throws Error(kResources), or what a fill function throws.
  void WriteTo(const std::string& path) const;

 private:
  struct Member;
  struct MemberSource;
  using RowFunction = std::function<void(int64_t first, int64_t rows, void* to)>;
  void AddRows(const std::string& name, ArrayType type, const std::vector<int64_t>& shape,
               RowFunction fill, NpzPacking packing);
  void AddBytes(const std::string& name, ArrayType type, const std::vector<int64_t>& shape,
                const void* data, NpzPacking packing);
  void AddCopy(const std::string& name, ArrayType type, const std::vector<int64_t>& shape,
               const void* data, size_t size);
  std::vector<Member> members_;
};

struct NpzArray {
  ArrayType type = ArrayType::kU8;
  std::vector<int64_t> shape;
  Buffer<uint8_t> bytes;

  int64_t num_elements() const { return bytes.size() / SizeOf(type); }
  template <typename T>
  const T* As() const {
    return reinterpret_cast<const T*>(bytes.data());
  }
  std::string ShapeText() const;  // "(3, 4)"
};

// Reads members by name into memory. Throws Error(kInput) naming file and array. `budget`: the
// most bytes that all arrays read through this reader may have together.
class NpzReader {
 public:
  NpzReader(const std::string& path, uint64_t budget);
  ~NpzReader();

  std::vector<std::string> names() const;  // without ".npy"
  bool Has(const std::string& name) const;
  // Of any supported type.
  NpzArray Read(const std::string& name);
  // Exactly this type and shape; -1 in `shape` is any length.
  NpzArray Read(const std::string& name, ArrayType type, const std::vector<int64_t>& shape);
  // Its type and shape, without its values.
  NpzArray Describe(const std::string& name);
  // The same array, some rows of its first axis at a time: as many as a few megabytes hold, the
  // array's shape but for their number. An array without values is taken once, as it is.
  void ReadRows(const std::string& name,
                const std::function<void(int64_t first, const NpzArray& rows)>& take);
  template <typename T>
  T ReadScalar(const std::string& name) {
    return *Read(name, ArrayTypeOf<T>::value, {}).template As<T>();
  }
  std::string ReadText(const std::string& name);
  const std::string& path() const { return path_; }

 private:
  struct Archive;
  class OpenMember;
  OpenMember Open(const std::string& name);
  OpenMember OpenWithinBudget(const std::string& name);
  std::string path_;
  uint64_t budget_;
  std::unique_ptr<Archive> archive_;
};

// Throws Error(kInput) if the file's array "regrade_version" exists and is larger than `known`:
// a newer program wrote the file.
void RefuseNewerFormat(NpzReader* file, int32_t known);

}  // namespace regrade
