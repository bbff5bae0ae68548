// Splats as a field: rendered, stored, checkpointed, and the photos that they are fitted to.
#include "kernels/splats/splat_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "kernels/base/half.h"
#include "kernels/image/undistort_photo.h"
#include "kernels/render/field_renderer.h"
#include "kernels/splats/covariance.h"
#include "kernels/splats/rendered_splats.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/seen_field.h"
#include "pipeline/fields/splat_checkpoint.h"
#include "pipeline/fields/splat_ply.h"
#include "pipeline/images/still_file.h"
#include "pipeline/run/fit_kind.h"
#include "tests/support/expect_error.h"
#include "tests/support/small_splats.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::CastSplats;
using testing::RandomSplats;
using testing::SplatCameraOf;
using testing::TemporaryFolder;

const GridFrame kBox{{}, {0.1f, 0, 0}, {1, 2, 1}};

RadianceField SmallSplatField(int64_t count, int basis, uint64_t seed = 1) {
  return FieldOfSplats(CastSplats<float>(RandomSplats(count, basis, seed)), kBox, 0.2f, -1);
}

template <typename A, typename B>
bool Same(const A& a, const B& b) {
  return std::equal(a.data(), a.data() + a.size(), b.data(), b.data() + b.size());
}

class SplatFieldOf : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Harmonics, SplatFieldOf, ::testing::Values(9, 16));

TEST_P(SplatFieldOf, RendersAsThePlainPicture) {
  const RadianceField field = SmallSplatField(200, GetParam());
  const Camera camera = SplatCameraOf(61, 43);
  const RenderedView plain =
      RenderedSplats(RenderSplatsPlain(SplatsOf(field), camera, SplatOptionsOf(field)));
  const RenderedView view = FieldRenderer(field, Backend::kCpu).Render(camera);
  for (size_t i = 0; i < plain.color.pixels.size(); ++i)
    ASSERT_NEAR(view.color.pixels[i], plain.color.pixels[i], 2e-5) << i;
  // Where a splat leaves half of the light to a rounding, the next one may be taken.
  int64_t others = 0;
  for (size_t i = 0; i < plain.depth.pixels.size(); ++i)
    others += !(std::abs(view.depth.pixels[i] - plain.depth.pixels[i]) < 1e-3);
  EXPECT_LE(others, plain.depth.num_pixels() / 1000);  // as FastSplats.RendersAsThePlainPicture
}

// As a styled field and its source are rendered: the same bits as alone.
TEST(SplatField, APairIsTwoViews) {
  const RadianceField field = SmallSplatField(200, 4);
  RadianceField other = field;
  other.appearance = SmallSplatField(200, 9, 2).appearance;
  other.background = {1, 0, 0.5f};
  const Camera camera = SplatCameraOf(61, 43);
  const FieldRenderer a(field, Backend::kCpu), b(other, Backend::kCpu);
  const RenderedPair pair = a.RenderWith(b, camera);
  EXPECT_EQ(pair.view.color.pixels, a.Render(camera).color.pixels);
  EXPECT_EQ(pair.other_color.pixels, b.Render(camera).color.pixels);
}

TEST(SplatField, AFileKeepsMeansAndRoundsTheRestToHalves) {
  const TemporaryFolder folder;
  for (const int basis : {1, 4, 9, 16}) {
    StoredField out{SmallSplatField(50, basis), {}, {}};
    out.field_from_world.scale = 3;
    WriteFieldFile(folder / "field.npz", out);
    const StoredField in = ReadFieldFile(folder / "field.npz");
    const SplatGeometry &a = in.field.geometry->splats, &b = out.field.geometry->splats;
    ASSERT_TRUE(a.on());
    EXPECT_TRUE(Same(a.mean, b.mean));
    for (const auto member :
         {&SplatGeometry::log_scale, &SplatGeometry::quaternion, &SplatGeometry::opacity_logit})
      for (int64_t i = 0; i < (b.*member).size(); ++i)
        ASSERT_EQ((a.*member)[i], FloatFromHalf(HalfFromFloat((b.*member)[i])));
    EXPECT_EQ(in.field.appearance.basis, basis);
    for (int64_t i = 0; i < in.field.appearance.sh.size(); ++i)
      ASSERT_EQ(in.field.appearance.sh[i],
                FloatFromHalf(HalfFromFloat(out.field.appearance.sh[i])));
    EXPECT_EQ(in.field.near_clip, 0.2f);
    EXPECT_EQ(in.field.geometry->frame.radius, kBox.radius);
    EXPECT_EQ(in.field_from_world.scale, 3);
    WriteFieldFile(folder / "again.npz", in);
    EXPECT_EQ(testing::ReadText(folder / "again.npz"), testing::ReadText(folder / "field.npz"));
  }
}

TEST(SplatField, CamerasReadWhatTheySee) {
  const TemporaryFolder folder;
  WriteFieldFile(folder / "field.npz", {SmallSplatField(300, 9), {}, {}});
  const StoredField whole = ReadFieldFile(folder / "field.npz");
  EXPECT_TRUE(whole.records.all);
  EXPECT_EQ(whole.records.of, 300);
  Camera narrow = SplatCameraOf(40, 30);
  narrow.fx *= 6, narrow.fy *= 6;
  Camera aside = narrow;
  aside.cx = -60;
  for (const std::vector<Camera>& cameras : {std::vector{narrow}, std::vector{narrow, aside}}) {
    const StoredField seen =
        SeenPart(ReadFieldGeometry(folder / "field.npz"), folder / "field.npz", cameras);
    const KeptRecords& records = seen.records;
    ASSERT_EQ(records.of, 300);
    ASSERT_FALSE(records.all);
    ASSERT_EQ(std::ssize(records.kept), seen.field.geometry->num_voxels());
    EXPECT_GT(std::ssize(records.kept), 3);
    EXPECT_LT(std::ssize(records.kept), 290);
    const auto logits = whole.field.geometry->splats.opacity_logit;
    EXPECT_TRUE(Same(records.Pick(std::vector<float>(logits.begin(), logits.end())),
                     seen.field.geometry->splats.opacity_logit));
    for (const Camera& camera : cameras)
      EXPECT_EQ(FieldRenderer(seen.field, Backend::kCpu).Render(camera).color.pixels,
                FieldRenderer(whole.field, Backend::kCpu).Render(camera).color.pixels);
  }
  Camera away = narrow;
  away.cx = 1e6;
  EXPECT_EQ(SeenPart({whole}, folder / "field.npz", {away}).records.kept.size(), 1u);

  const StoredField shapes = ReadFieldGeometry(folder / "field.npz");
  EXPECT_TRUE(Same(shapes.field.geometry->splats.mean, whole.field.geometry->splats.mean));
  EXPECT_EQ(shapes.field.appearance.basis, 1);
}

// Records of voxels have no room for degree 3.
TEST(SplatField, VoxelsOfDegreeThreeAreRefused) {
  RadianceField field;
  auto geometry = std::make_shared<Geometry>();
  geometry->frame.resolution = {2, 2, 2};
  geometry->links.Resize(8);
  geometry->density.Resize(8);
  for (int32_t i = 0; i < 8; ++i) geometry->links[i] = i;
  field.geometry = geometry;
  for (const int basis : {9, 16}) {
    field.appearance.basis = basis;
    field.appearance.sh.Resize(8 * field.appearance.stride());
    if (basis == 9)
      Validate(field, "nine");
    else
      EXPECT_REGRADE_ERROR(Validate(field, "sixteen"), ExitCode::kInput, "of voxels 1, 4 or 9");
  }
}

TEST(SplatField, AFileWithAValueThatIsNotFiniteIsRefused) {
  const TemporaryFolder folder;
  RadianceField field = SmallSplatField(5, 1);
  auto geometry = std::make_shared<Geometry>(*field.geometry);
  geometry->splats.mean[4] = std::nanf("");
  field.geometry = geometry;
  WriteFieldFile(folder / "field.npz", {field, {}, {}});
  EXPECT_REGRADE_ERROR(ReadFieldFile(folder / "field.npz"), ExitCode::kInput, "not finite");
}

TEST(SplatCheckpoint, AStateComesBackBitForBit) {
  SplatFitState state;
  state.splats = CastSplats<float>(RandomSplats(7, 16, 1));
  state.first_moment = CastSplats<float>(RandomSplats(7, 16, 2));
  state.second_moment = CastSplats<float>(RandomSplats(7, 16, 3));
  state.step = 17;
  state.tally = {1.5, 2.5, 3, 4, 5, 6, 7, {{8, 9.5, 10.5, 11}}};
  const std::string bytes = PackSplatFitState(state, "a note").Joined();
  std::string note;
  const std::optional<SplatFitState> back = UnpackSplatFitState(bytes, &note);
  ASSERT_TRUE(back);
  EXPECT_EQ(note, "a note");
  EXPECT_EQ(back->step, 17);
  EXPECT_EQ(PackSplatFitState(*back, note).Joined(), bytes);
  EXPECT_EQ(back->second_moment.sh, state.second_moment.sh);
  for (const size_t size : {size_t{0}, size_t{3}, bytes.size() / 2, bytes.size() - 1})
    EXPECT_FALSE(UnpackSplatFitState(std::string_view(bytes).substr(0, size), &note)) << size;
}

// The file's floats, read by their places, rendered by the same camera in the capture's world.
TEST_P(SplatFieldOf, APlyIsThePictureInTheCapturesWorld) {
  const size_t basis = static_cast<size_t>(GetParam()), rest = basis - 1;
  const TemporaryFolder folder;
  StoredField stored{SmallSplatField(80, GetParam()), {}, {}};
  const double turn[4] = {0.8, 0.1, -0.5, 0.3};
  stored.field_from_world = {2.5, RotationOf(turn), {0.3, -0.2, 0.7}};
  WriteSplatPly(folder / "field.ply", stored, "a comment");
  const std::string file = testing::ReadText(folder / "field.ply");
  const size_t begin = file.find("end_header\n") + 11;
  EXPECT_NE(file.find("element vertex 80\n"), std::string::npos);
  const size_t floats = 3 + 3 + 3 * basis + 1 + 3 + 4;
  ASSERT_EQ(file.size() - begin, 80 * floats * sizeof(float));
  Splats splats(80, GetParam());
  for (size_t i = 0; i < 80; ++i) {
    std::vector<float> values(floats);
    const float* const row = values.data();
    std::memcpy(values.data(), file.data() + begin + i * floats * sizeof(float),
                floats * sizeof(float));
    const float* const after = row + 9 + 3 * rest;
    Splat<float> splat;
    splat.mean = {row[0], row[1], row[2]};
    splat.opacity_logit = after[0];
    splat.log_scale = {after[1], after[2], after[3]};
    std::copy_n(after + 4, 4, splat.quaternion);
    splats.Set(static_cast<int64_t>(i), splat);
    for (size_t c = 0; c < 3; ++c) {
      splats.sh[(3 * i + c) * basis] = row[6 + c];
      std::copy_n(row + 9 + rest * c, rest, &splats.sh[(3 * i + c) * basis + 1]);
    }
  }
  splats.background = stored.field.background;
  Camera in_world = SplatCameraOf(61, 43);
  in_world.camera_from_world.translation = in_world.camera_from_world.translation * 0.4;
  const Camera in_field = in_world.Transformed(stored.field_from_world);
  const SplatOptions options = SplatOptionsOf(stored.field);
  SplatOptions world_options = options;
  world_options.near_plane /= 2.5;
  const auto a = RenderSplatsPlain(SplatsOf(stored.field), in_field, options),
             b = RenderSplatsPlain(splats.view(), in_world, world_options);
  double darkest = 1;
  for (size_t p = 0; p < a.color.size(); ++p) ASSERT_NEAR(a.color[p], b.color[p], 1e-4) << p;
  for (const float t : a.transmittance) darkest = std::min(darkest, double{t});
  EXPECT_LT(darkest, 0.5);  // the camera sees splats
}

// A lens bends the photo's edges: what the undistorted photo does not show is masked.
TEST(WorkingViews, PinholesHaveUndistortedPhotosAndMasks) {
  const TemporaryFolder folder;
  Image photo(64, 48);
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 64; ++x)
      for (int c = 0; c < 3; ++c)
        photo.at(x, y)[c] = static_cast<float>((x * (c + 1) + 2 * y) % 97 + 60) / 255;
  WriteStill(folder / "photo.png", photo);
  Capture capture;
  capture.views.push_back({"photo.png", "photo.png", folder / "photo.png", {}});
  Camera& camera = capture.views[0].camera;
  camera.width = 64, camera.height = 48;
  camera.fx = camera.fy = 50, camera.cx = 32, camera.cy = 24;
  camera.lens = LensModel::kOpenCv;
  camera.distortion[0] = 0.2;  // a pincushion: the photo's corners are cut off
  const WorkingViews views(capture, 64, 0), pinholes = views.Pinholes();
  EXPECT_TRUE(views.Mask(0).empty());
  EXPECT_EQ(views.CameraOf(0).lens, LensModel::kOpenCv);
  EXPECT_EQ(pinholes.CameraOf(0).lens, LensModel::kPinhole);
  const Image expected = UndistortPhoto(views.Photo(0), camera), seen = pinholes.Photo(0),
              mask = pinholes.Mask(0);
  int beyond = 0;
  for (int64_t p = 0; p < mask.num_pixels(); ++p) {
    const size_t at = static_cast<size_t>(p);
    const bool known = std::isfinite(expected.pixels[3 * at]);
    EXPECT_EQ(mask.pixels[at], known ? 1 : 0) << p;
    if (known) {
      EXPECT_EQ(seen.pixels[3 * at], expected.pixels[3 * at]) << p;
    }
    beyond += !known;
  }
  EXPECT_GT(beyond, 4);
  EXPECT_LT(beyond, mask.num_pixels() / 2);
  // The corner has the colour of the nearest pixel of its row, or of the nearest row.
  const auto near_corner = [&] {
    for (int y = 0; y < 48; ++y)
      for (int x = 0; x < 64; ++x)
        if (*mask.at(x, y) > 0) return *expected.at(x, y);
    return -1.0f;
  };
  EXPECT_EQ(*seen.at(0, 0), near_corner());
  // A picture of another size, such as a mask or an edit, goes the same way.
  Image large(128, 96, 1);
  std::ranges::fill(large.pixels, 0.25f);
  EXPECT_EQ(pinholes.AsSeen(0, large).pixels, large.pixels);
  EXPECT_EQ(pinholes.Lenses().Photo(0).pixels, views.Photo(0).pixels);
}

}  // namespace
}  // namespace regrade
