// Packs values and arrays into a string, for checkpoints. Both directions have the same
// functions, so that one list of members serves both. Reading never goes beyond the end,
// although a hash has already been checked.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "kernels/base/buffer.h"

namespace regrade {

class BytePacker {
 public:
  // Without it, the growing string needs up to three times its final size.
  void Reserve(size_t bytes) { bytes_.reserve(bytes); }

  template <typename T>
  void Value(const T* value) {
    static_assert(std::is_arithmetic_v<T>);
    bytes_.append(reinterpret_cast<const char*>(value), sizeof *value);
  }
  // Any array of numbers with data() and size().
  template <typename Array>
  void Values(const Array* array) {
    const int64_t size = std::ssize(*array);
    Value(&size);
    bytes_.append(reinterpret_cast<const char*>(array->data()), sizeof(*array->data()) * size);
  }
  // Whether an optional part follows: as the caller says here, by what is left when unpacking.
  bool More(bool more) const { return more; }
  bool ok() const { return true; }
  std::string Take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

// After a read beyond the end, all values read as zero or empty and ok() is false.
class ByteUnpacker {
 public:
  explicit ByteUnpacker(std::string_view bytes) : left_(bytes) {}

  template <typename T>
  void Value(T* value) {
    static_assert(std::is_arithmetic_v<T>);
    *value = T{};
    if (!Fits(sizeof *value)) return;
    std::memcpy(value, left_.data(), sizeof *value);
    left_.remove_prefix(sizeof *value);
  }
  // `resize(n)` resizes `array`.
  template <typename Array, typename Resize>
  void Values(Array* array, const Resize& resize) {
    int64_t size = 0;
    Value(&size);
    constexpr size_t kElement = sizeof(*array->data());
    if (size < 0 || static_cast<uint64_t>(size) > left_.size() / kElement) ok_ = false;
    if (!ok_) return;
    resize(size);
    const size_t bytes = kElement * static_cast<size_t>(size);
    if (bytes > 0) std::memcpy(array->data(), left_.data(), bytes);
    left_.remove_prefix(bytes);
  }
  template <typename T>
  void Values(std::vector<T>* array) {
    Values(array, [array](int64_t n) { array->resize(n); });
  }
  template <typename T>
  void Values(Buffer<T>* array) {
    Values(array, [array](int64_t n) { array->Resize(n); });
  }
  void Values(std::string* array) {
    Values(array, [array](int64_t n) { array->resize(n); });
  }

  bool More(bool) const { return ok_ && !left_.empty(); }
  bool ok() const { return ok_; }
  bool at_end() const { return ok_ && left_.empty(); }

 private:
  bool Fits(size_t size) {
    if (left_.size() < size) ok_ = false;
    return ok_;
  }

  std::string_view left_;
  bool ok_ = true;
};

}  // namespace regrade
