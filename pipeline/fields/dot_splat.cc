#include "pipeline/fields/dot_splat.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "pipeline/fields/colored_splat.h"

namespace regrade {
namespace {

constexpr size_t kRecord = 32, kLookedAt = 1000;

struct Record {
  float mean[3], scale[3];
  uint8_t color[4], rotation[4];
};
static_assert(sizeof(Record) == kRecord);

Record RecordAt(std::string_view bytes, size_t i) {
  Record record;
  std::memcpy(&record, bytes.data() + i * kRecord, kRecord);
  return record;
}

}  // namespace

bool LooksLikeDotSplat(std::string_view bytes) {
  if (bytes.empty() || bytes.size() % kRecord != 0) return false;
  constexpr float kLeast = 1e-15f, kMost = 1e9f;
  for (size_t i = 0; i < std::min(bytes.size() / kRecord, kLookedAt); ++i) {
    const Record record = RecordAt(bytes, i);
    for (int a = 0; a < 3; ++a) {
      const float place = std::abs(record.mean[a]), size = record.scale[a];
      if (!(place == 0 || (place >= kLeast && place <= kMost))) return false;
      if (!(size == 0 || (size >= kLeast && size <= kMost))) return false;
    }
  }
  return true;
}

SplatScene ReadDotSplat(std::string_view bytes, uint64_t budget, const std::string& where) {
  const size_t count = bytes.size() / kRecord;
  SplatCollector collector(count, 1, bytes.size(), budget, where);
  for (size_t i = 0; i < count; ++i) {
    const Record from = RecordAt(bytes, i);
    ColoredSplat to;
    for (int a = 0; a < 3; ++a) {
      to.splat.mean[a] = from.mean[a];
      to.splat.log_scale[a] = std::log(from.scale[a]);
      to.sh[a] = static_cast<float>((from.color[a] / 255.0 - 0.5) / kSh0);
    }
    to.splat.opacity_logit = LogitOfByte(from.color[3]);
    for (int a = 0; a < 4; ++a)
      to.splat.quaternion[a] = static_cast<float>((from.rotation[a] - 128) / 128.0);
    collector.Add(to);
  }
  SplatScene scene = std::move(collector).Finish();
  scene.format = SplatFormat::kSplat;
  return scene;
}

}  // namespace regrade
