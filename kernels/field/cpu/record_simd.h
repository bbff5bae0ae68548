// A voxel's record as vectors; compiled once per instruction set inside rays_simd.h's
// namespace.
#pragma once

#include <algorithm>
#include <cstdint>

#include "kernels/field/cpu/rays.h"
#include "kernels/field/cpu/vector_simd.h"

namespace regrade::REGRADE_SIMD_NAMESPACE {
namespace {

// `kWidth` floats per vector, `kCount` vectors per record.
template <int kBasis>
struct RecordShape {
  static constexpr int kLanes = RecordLanes(kBasis);
  static constexpr int kWidth = kLanes < kWide ? kLanes : kWide;
  static constexpr int kCount = kLanes / kWidth;
  typedef float Vector __attribute__((vector_size(kWidth * sizeof(float))));
  // Vectors [kFirst(c), kLast(c)] hold all coefficients of channel c.
  static constexpr int kFirst(int channel) { return channel * kBasis / kWidth; }
  static constexpr int kLast(int channel) { return (channel * kBasis + kBasis - 1) / kWidth; }
};

template <int kBasis>
struct Record {
  using Shape = RecordShape<kBasis>;
  using Vector = typename Shape::Vector;
  Vector v[Shape::kCount];

  static Record Zero() { return Record{}; }
  static Record Load(const float* p) {
    Record r;
    for (int i = 0; i < Shape::kCount; ++i)
      r.v[i] = *reinterpret_cast<const Vector*>(p + i * Shape::kWidth);
    return r;
  }
  void Store(float* p) const {
    for (int i = 0; i < Shape::kCount; ++i)
      *reinterpret_cast<Vector*>(p + i * Shape::kWidth) = v[i];
  }
  void AddScaled(float s, const float* p) {
    for (int i = 0; i < Shape::kCount; ++i)
      v[i] += s * *reinterpret_cast<const Vector*>(p + i * Shape::kWidth);
  }
};

// Prefetches the record at `index`, which may be -1: a prefetch does not access the address.
template <int kBasis>
inline void PrefetchRecord(const float* records, int32_t index, bool for_writing = false) {
  constexpr int64_t kBytes = RecordLanes(kBasis) * sizeof(float);
  const auto at = reinterpret_cast<uintptr_t>(records) + static_cast<uintptr_t>(index * kBytes);
  for (int64_t line = 0; line < kBytes; line += 64) {
    if (for_writing)
      __builtin_prefetch(reinterpret_cast<const void*>(at + line), 1);
    else
      __builtin_prefetch(reinterpret_cast<const void*>(at + line), 0);
  }
}

// Slot of a voxel in the arena, created and zeroed at its first touch. Capacity is reserved
// beforehand.
inline int32_t SlotOf(GradientArena* arena, int32_t voxel, int lanes) {
  int32_t slot = arena->slot_of_voxel[voxel];
  if (slot < 0) {
    slot = static_cast<int32_t>(arena->voxel_of_slot.size());
    arena->slot_of_voxel[voxel] = slot;
    arena->voxel_of_slot.Resize(slot + 1);
    arena->voxel_of_slot[slot] = voxel;
    arena->gradient.Resize(static_cast<int64_t>(slot + 1) * lanes);
  }
  return slot;
}

inline void ReserveSlots(GradientArena* arena, int64_t more, int lanes) {
  const int64_t needed = arena->voxel_of_slot.size() + more;
  if (needed * lanes <= arena->gradient_capacity) return;
  const int64_t slots = std::max<int64_t>(needed, 2 * (arena->gradient_capacity / lanes));
  arena->voxel_of_slot.Reserve(slots);
  arena->gradient.Reserve(slots * lanes);
  arena->gradient_capacity = slots * lanes;
}

}  // namespace
}  // namespace regrade::REGRADE_SIMD_NAMESPACE
