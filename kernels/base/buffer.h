// An owner of memory aligned to a cache line, so that vector loads never straddle two lines.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <new>
#include <type_traits>
#include <utility>

#include "kernels/base/view.h"

namespace regrade {

inline constexpr int64_t kBufferAlignment = 64;  // bytes

// Holds trivially copyable values; contents are zero after Resize to a larger size.
template <typename T>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  Buffer() = default;
  explicit Buffer(int64_t size) { Resize(size); }
  Buffer(const Buffer& other) { *this = other; }
  Buffer(Buffer&& other) noexcept { Swap(other); }
  ~Buffer() { std::free(data_); }

  Buffer& operator=(const Buffer& other) {
    if (this == &other) return *this;
    Buffer copy(other.size_);
    if (other.size_ > 0)
      std::memcpy(static_cast<void*>(copy.data_), other.data_, sizeof(T) * other.size_);
    Swap(copy);
    return *this;
  }
  Buffer& operator=(Buffer&& other) noexcept {
    Swap(other);
    return *this;
  }

  // Keeps the old values, zeroes the new ones. Throws std::bad_alloc.
  void Resize(int64_t size) {
    if (size > capacity_) Reserve(size);
    if (size > size_)
      std::memset(static_cast<void*>(data_ + size_), 0, sizeof(T) * (size - size_));
    size_ = size;
  }

  void Reserve(int64_t capacity) {
    if (capacity <= capacity_) return;
    const int64_t bytes = (capacity * static_cast<int64_t>(sizeof(T)) + kBufferAlignment - 1) /
                          kBufferAlignment * kBufferAlignment;
    T* data = static_cast<T*>(std::aligned_alloc(kBufferAlignment, bytes));
    if (data == nullptr) throw std::bad_alloc();
    if (size_ > 0) std::memcpy(static_cast<void*>(data), data_, sizeof(T) * size_);
    std::free(data_);
    data_ = data;
    capacity_ = capacity;
  }

  void Clear() { size_ = 0; }

  T* data() { return data_; }
  const T* data() const { return data_; }
  int64_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  T& operator[](int64_t i) { return data_[i]; }
  const T& operator[](int64_t i) const { return data_[i]; }
  T* begin() { return data_; }
  T* end() { return data_ + size_; }
  const T* begin() const { return data_; }
  const T* end() const { return data_ + size_; }

  View<T> view() { return {data_, size_}; }
  View<const T> view() const { return {data_, size_}; }

  void Swap(Buffer& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
  }

 private:
  T* data_ = nullptr;
  int64_t size_ = 0;
  int64_t capacity_ = 0;
};

}  // namespace regrade
