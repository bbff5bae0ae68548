// Renders a scene of splats in double with the plain specification, for reference_splats.py.
//
//   splat_picture < SCENE > PICTURE
//
// SCENE is doubles: width, height, basis, count, fit pixel, near plane, blur, fx, fy, cx, cy,
// camera_from_world (rotation by rows, translation), background [3], and the arrays of
// SplatArrays in order. PICTURE is the arrays of SplatPicture.
#include <cstdio>
#include <vector>

#include "kernels/splats/render_picture.h"

namespace regrade {
namespace {

bool Read(double* values, size_t n) {
  return std::fread(values, sizeof(double), n, stdin) == n;
}
bool Write(const std::vector<double>& values) {
  return std::fwrite(values.data(), sizeof(double), values.size(), stdout) == values.size();
}

int Run() {
  double head[26];
  if (!Read(head, 26)) return 1;
  Camera camera;
  camera.width = static_cast<int>(head[0]), camera.height = static_cast<int>(head[1]);
  camera.fx = head[7], camera.fy = head[8], camera.cx = head[9], camera.cy = head[10];
  for (int i = 0; i < 9; ++i) camera.camera_from_world.rotation(i / 3, i % 3) = head[11 + i];
  camera.camera_from_world.translation = {head[20], head[21], head[22]};
  const SplatOptions options{head[5], head[6], head[4]};
  SplatArrays<double> splats(static_cast<int64_t>(head[3]), static_cast<int>(head[2]));
  splats.background = {head[23], head[24], head[25]};
  for (std::vector<double>* values :
       {&splats.mean, &splats.log_scale, &splats.quaternion, &splats.opacity_logit, &splats.sh})
    if (!Read(values->data(), values->size())) return 1;
  const SplatPicture<double> picture = RenderSplatsPlain(splats.view(), camera, options);
  return Write(picture.color) && Write(picture.depth) && Write(picture.median_depth) &&
                 Write(picture.transmittance)
             ? 0
             : 1;
}

}  // namespace
}  // namespace regrade

int main() { return regrade::Run(); }
