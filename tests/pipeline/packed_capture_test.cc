// A packed capture reads back as it was written, and damage is named.
#include "pipeline/capture/packed_capture.h"

#include <gtest/gtest.h>

#include "kernels/base/random.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

PackedCapture SmallCapture() {
  PackedCapture capture;
  capture.scene.field_from_world = {0.25, Mat3d(), {1, -2, 3}};
  capture.scene.ndc = {1.5, 2};
  capture.scene.box.radius = {1, 0.5f, 0.75f};
  capture.scene.box.near_clip = 0.125f;
  capture.scene.box.layers = 128;
  capture.scene.box.far_surroundings = true;
  capture.scene.box.background = Vec3f{1, 0.5f, 0};
  for (int i = 0; i < 3; ++i) {
    PackedView view;
    view.file = "photo " + std::to_string(i) + ".jpg";
    view.held_out = i == 1;
    view.camera.width = 20 + i;
    view.camera.height = 10;
    view.camera.fx = 30.5, view.camera.fy = 31, view.camera.cx = 10, view.camera.cy = 5;
    view.camera.lens = LensModel::kOpenCv;
    view.camera.distortion = {0.1, -0.02, 1e-3, 0};
    view.camera.camera_from_world.translation = {0.1 * i, 2, 3};
    view.camera.ndc = capture.scene.ndc;
    view.photo = Image(20 + i, 10, 3);
    for (size_t p = 0; p < view.photo.pixels.size(); ++p)
      view.photo.pixels[p] =
          static_cast<float>(RandomIndex(3, static_cast<uint64_t>(i), p, 256)) / 255.0f;
    capture.views.push_back(view);
  }
  return capture;
}

TEST(PackedCapture, ReadsBackAsWritten) {
  const testing::TemporaryFolder folder;
  PackedCapture capture = SmallCapture();
  capture.decided = R"({"scene-margin": 0.25})";
  WritePackedCapture(folder / "a.npz", capture);
  const PackedCapture back = ReadPackedCapture(folder / "a.npz");
  ASSERT_EQ(back.views.size(), 3u);
  EXPECT_EQ(back.decided, capture.decided);
  EXPECT_EQ(back.scene.field_from_world.scale, 0.25);
  EXPECT_EQ(back.scene.field_from_world.translation,
            capture.scene.field_from_world.translation);
  EXPECT_EQ(back.scene.ndc.b, 2);
  EXPECT_EQ(back.scene.box.radius, capture.scene.box.radius);
  EXPECT_EQ(back.scene.box.layers, 128);
  EXPECT_TRUE(back.scene.box.far_surroundings);
  ASSERT_TRUE(back.scene.box.background);
  EXPECT_EQ(*back.scene.box.background, *capture.scene.box.background);
  EXPECT_EQ(back.style.num_pixels(), 0);
  PackedCapture with_style = capture;
  with_style.style = capture.views[1].photo;
  WritePackedCapture(folder / "styled.npz", with_style);
  EXPECT_EQ(ReadPackedCapture(folder / "styled.npz").style.pixels, with_style.style.pixels);
  for (size_t i = 0; i < 3; ++i) {
    const PackedView &a = capture.views[i], &b = back.views[i];
    EXPECT_EQ(a.file, b.file);
    EXPECT_EQ(a.held_out, b.held_out);
    EXPECT_EQ(a.photo.pixels, b.photo.pixels);  // levels of 8 bits come back to the bit
    const Ray before = a.camera.PixelRay(3, 4), after = b.camera.PixelRay(3, 4);
    EXPECT_EQ(before.origin, after.origin);
    EXPECT_EQ(before.direction, after.direction);
  }
}

TEST(PackedCapture, F71_DamageIsNamed) {
  const testing::TemporaryFolder folder;
  PackedCapture capture = SmallCapture();
  capture.views[2].camera.height = 5000;  // more than its pixels
  capture.views[2].photo = Image(22, 5000, 3);
  WritePackedCapture(folder / "a.npz", capture);
  const std::string bytes = testing::ReadText(folder / "a.npz");
  testing::WriteText(folder / "cut.npz", bytes.substr(0, bytes.size() / 2));
  EXPECT_REGRADE_ERROR(ReadPackedCapture(folder / "cut.npz"), ExitCode::kInput, "cut.npz");
  capture.views[0].camera.fx = 0;
  WritePackedCapture(folder / "b.npz", capture);
  EXPECT_REGRADE_ERROR(ReadPackedCapture(folder / "b.npz"), ExitCode::kInput, "cameras");
}

TEST(PackedCapture, F69_H134_ImplausibleValues) {
  const testing::TemporaryFolder folder;
  const auto refuse = [&folder](const PackedCapture& capture, const char* part) {
    WritePackedCapture(folder / "a.npz", capture);
    EXPECT_REGRADE_ERROR(ReadPackedCapture(folder / "a.npz"), ExitCode::kInput, part);
  };
  PackedCapture capture = SmallCapture();
  capture.views[1].camera.fx = 1e9;
  refuse(capture, "a camera is implausible");
  capture = SmallCapture();
  capture.views[1].camera.camera_from_world.rotation(0, 0) = 2;
  refuse(capture, "a camera is implausible");
  capture = SmallCapture();
  capture.scene.field_from_world.scale = 0;
  refuse(capture, "its box or frame");
  capture = SmallCapture();
  capture.scene.box.radius.y = -1;
  refuse(capture, "its box or frame");
  capture = SmallCapture();
  capture.scene.ndc = {1.5, 0};
  refuse(capture, "its box or frame");
}

}  // namespace
}  // namespace regrade
