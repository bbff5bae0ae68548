#include "pipeline/page/sphere_order.h"

#include "kernels/base/error.h"

namespace regrade {
namespace {

bool HasDensity(const SphereGeometry& spheres, int x, int y) {
  const int columns = 2 * spheres.resolution;
  const int32_t link = spheres.links[((x + columns) % columns) * spheres.resolution + y];
  if (link < 0) return false;
  for (int i = 0; i < spheres.layers; ++i)
    if (spheres.density[int64_t{link} * spheres.layers + i] > 0) return true;
  return false;
}

bool IsSeen(const SphereGeometry& spheres, int x, int y) {
  for (int i = -1; i <= 1; ++i)
    for (int j = -1; j <= 1; ++j)
      if (y + j >= 0 && y + j < spheres.resolution && HasDensity(spheres, x + i, y + j))
        return true;
  return false;
}

}  // namespace

std::string MaskOfSpheres(const SphereGeometry& spheres) {
  const int r = spheres.resolution;
  std::string mask(static_cast<size_t>((2 * r * r + 7) / 8), '\0');
  for (int x = 0; x < 2 * r; ++x)
    for (int y = 0; y < r; ++y)
      if (const int at = x * r + y; spheres.links[at] >= 0 && IsSeen(spheres, x, y))
        mask[static_cast<size_t>(at / 8)] |= static_cast<char>(1 << (at % 8));
  return mask;
}

SphereOrder OrderOfSpheres(std::string_view mask, int resolution, int layers) {
  const int texels = 2 * resolution * resolution;
  if (mask.size() != static_cast<size_t>((texels + 7) / 8))
    throw InputError("the mask of the background has another size");
  SphereOrder order;
  std::vector<int32_t> column(static_cast<size_t>(texels), -1);
  for (int at = 0; at < texels; ++at) {
    if ((static_cast<unsigned char>(mask[static_cast<size_t>(at / 8)]) >> (at % 8) & 1) == 0)
      continue;
    const auto own = static_cast<int32_t>(order.place.size());
    if ((own + int64_t{1}) * layers > kMaxPageVoxels)
      throw InputError("the background is too large for a page");
    column[static_cast<size_t>(at)] = own;
    order.place.push_back(at);
    const int32_t north = at % resolution > 0 ? column[static_cast<size_t>(at - 1)] : -1;
    const int32_t west = at >= resolution ? column[static_cast<size_t>(at - resolution)] : -1;
    for (int i = 0; i < layers; ++i) {
      EarlierRecords earlier{-1, -1, -1};
      int n = 0;
      if (i > 0) earlier[n++] = own * layers + i - 1;
      if (north >= 0) earlier[n++] = north * layers + i;
      if (west >= 0) earlier[n++] = west * layers + i;
      order.earlier.push_back(earlier);
    }
  }
  return order;
}

}  // namespace regrade
