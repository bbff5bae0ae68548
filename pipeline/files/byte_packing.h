// Packs values and arrays for checkpoints. Reading never goes beyond the end, although a hash
// has already been checked.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "kernels/base/buffer.h"

namespace regrade {

class BytePacker {
 public:
  template <typename T>
  void Value(const T& value) {
    static_assert(std::is_arithmetic_v<T>);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  // Any array of numbers with data() and size().
  template <typename Array>
  void Values(const Array& array) {
    Value(static_cast<int64_t>(array.size()));
    bytes_.append(reinterpret_cast<const char*>(array.data()),
                  sizeof(*array.data()) * static_cast<size_t>(array.size()));
  }
  // The same bytes without a copy: the array must not change until they have been used.
  template <typename Array>
  void Reference(const Array& array) {
    Value(static_cast<int64_t>(array.size()));
    references_.push_back({bytes_.size(),
                           {reinterpret_cast<const char*>(array.data()),
                            sizeof(*array.data()) * static_cast<size_t>(array.size())}});
  }

  // All bytes in their order, in this packer and in the arrays that it refers to.
  std::vector<std::string_view> Pieces() const {
    std::vector<std::string_view> pieces;
    size_t begin = 0;
    for (const auto& [end, array] : references_) {
      pieces.push_back(std::string_view(bytes_).substr(begin, end - begin));
      pieces.push_back(array);
      begin = end;
    }
    pieces.push_back(std::string_view(bytes_).substr(begin));
    return pieces;
  }
  std::string Joined() const {
    std::string all;
    for (const std::string_view piece : Pieces()) all += piece;
    return all;
  }

 private:
  std::string bytes_;
  std::vector<std::pair<size_t, std::string_view>> references_;  // after so many of bytes_
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
    Values(array, [array](int64_t n) { array->resize(static_cast<size_t>(n)); });
  }
  template <typename T>
  void Values(Buffer<T>* array) {
    Values(array, [array](int64_t n) { array->Resize(n); });
  }
  void Values(std::string* array) {
    Values(array, [array](int64_t n) { array->resize(static_cast<size_t>(n)); });
  }

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
