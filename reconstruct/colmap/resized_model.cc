#include "reconstruct/colmap/resized_model.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <tuple>

namespace regrade {

bool SameAspect(const Camera& camera, int width, int height) {
  const double w = camera.width, h = camera.height;
  return std::abs(width - height * w / h) < 1 || std::abs(height - width * h / w) < 1;
}

int ResizeToPhotos(const std::vector<StagedPhoto>& photos, ColmapModel* model) {
  std::map<std::string, const StagedPhoto*> by_name;
  for (const StagedPhoto& photo : photos) by_name[photo.name] = &photo;
  uint32_t next = 1;
  for (const ColmapCamera& camera : model->cameras) next = std::max(next, camera.id + 1);
  std::map<std::tuple<uint32_t, int, int>, uint32_t> resized;  // camera and size
  int count = 0;
  for (ColmapImage& image : model->images) {
    const auto found = by_name.find(image.name);
    if (found == by_name.end()) continue;
    const int width = found->second->width, height = found->second->height;
    const ColmapCamera camera = *model->FindCamera(image.camera_id);
    const Camera& lens = camera.intrinsics;
    if ((lens.width == width && lens.height == height) || !SameAspect(lens, width, height))
      continue;
    const auto [entry, is_new] = resized.try_emplace({camera.id, width, height}, next);
    if (is_new) model->cameras.push_back({next++, camera.lens, lens.Resized(width, height)});
    for (ColmapKeypoint& keypoint : image.keypoints) {
      keypoint.u *= static_cast<double>(width) / lens.width;
      keypoint.v *= static_cast<double>(height) / lens.height;
    }
    image.camera_id = entry->second;
    ++count;
  }
  if (count == 0) return 0;
  std::set<uint32_t> in_use;
  for (const ColmapImage& image : model->images) in_use.insert(image.camera_id);
  std::erase_if(model->cameras,
                [&](const ColmapCamera& camera) { return in_use.count(camera.id) == 0; });
  return count;
}

}  // namespace regrade
