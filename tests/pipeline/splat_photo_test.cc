// Splats that another program fitted, seen by one of its cameras: the units, axes and signs of
// the reader are those of the photo.
#include <gtest/gtest.h>

#include "kernels/image/resize.h"
#include "kernels/splats/cpu/render_splats.h"
#include "pipeline/images/image_file.h"
#include "pipeline/splat_files/read_splats.h"
#include "tests/support/data.h"
#include "tests/support/psnr.h"

namespace regrade {
namespace {

TEST(SplatFiles, RealSplatsShowTheirPhoto) {
  REGRADE_NEED_DATA("splats/fox_mcmc_60k.ply");
  REGRADE_NEED_DATA("fox/images/0001.jpg");
  const SplatScene scene = ReadSplats(testing::DataPath("splats/fox_mcmc_60k.ply"));
  // The first camera of fox_mcmc_60k_cameras.json, whose photo was held out.
  Camera camera;
  camera.width = 267, camera.height = 476;
  camera.fx = 343.9980198377293, camera.fy = 343.7926329848415;
  camera.cx = 133.5, camera.cy = 238;
  Mat3d world_from_camera;
  world_from_camera.row[0] = {-0.03562890258602681, 0.9977642491745345, 0.05654276584756697};
  world_from_camera.row[1] = {0.8116989735537209, -0.004113707070664634, 0.5840615153782794};
  world_from_camera.row[2] = {0.5829882997388118, 0.06670517583601863, -0.8097376500350807};
  const Vec3d center{-0.027891476255964984, -0.7842593389297035, 1.140255089311304};
  camera.camera_from_world.rotation = world_from_camera.Transposed();
  camera.camera_from_world.translation = -(camera.camera_from_world.rotation * center);
  SplatOptions options;
  options.near_plane = 0.01;
  const SplatPicture<float> picture =
      RenderSplats(MakeSplatFrame(scene.splats.view(), camera, options));
  Image seen(camera.width, camera.height);
  seen.pixels.assign(picture.color.begin(), picture.color.end());
  const Image photo = Resize(DecodePhoto(testing::DataPath("fox/images/0001.jpg")).image,
                             camera.width, camera.height);
  const double psnr = testing::Psnr(seen, photo);
  RecordProperty("psnr", std::to_string(psnr));
  // 30.2 dB over all held-out photos, without their lenses' distortion, is what the program
  // that fitted them measured.
  EXPECT_GT(psnr, 22);
}

}  // namespace
}  // namespace regrade
