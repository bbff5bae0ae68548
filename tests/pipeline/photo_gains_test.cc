// Exposures of a synthetic capture, from its photos to the gains that are undone.
#include "pipeline/capture/photo_gains.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "kernels/base/error.h"
#include "kernels/scene/srgb.h"
#include "pipeline/capture/scene_profile.h"
#include "pipeline/capture/synth_effects.h"
#include "pipeline/capture/track_colors.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/files/json_file.h"
#include "pipeline/images/image_file.h"
#include "tests/support/expect_error.h"
#include "tests/support/source_dir.h"
#include "tests/support/synthetic_photos.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr int kViews = 8;
constexpr uint64_t kSeed = 4;

class SyntheticExposure : public ::testing::Test {
 protected:
  Capture MakeCapture(bool exposure) {
    testing::SyntheticPhotos photos{.views = kViews, .seed = kSeed};
    photos.effects.exposure = exposure;
    return testing::MakeSyntheticPhotos(photos, folder_.path());
  }

  const testing::TemporaryFolder folder_;
};

TEST_F(SyntheticExposure, GainsOfTheSimulationAreFoundWithinTwoPercent) {
  const SceneProfile profile = ProfileScene(MakeCapture(true), 2, "auto");
  const EffectReport& row = profile.effects.back();
  EXPECT_EQ(row.name, "exposure");
  EXPECT_TRUE(row.on) << EffectLine(row);
  ASSERT_EQ(profile.gains.of_view.size(), size_t{kViews});
  double mean = 0;
  for (int v = 0; v < kViews; ++v) mean += std::log(SynthGain(kSeed, v, kViews)) / kViews;
  for (int v = 0; v < kViews; ++v)
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(profile.gains.Of(v).light[c] / (SynthGain(kSeed, v, kViews) / std::exp(mean)),
                  1, 0.02)
          << "photo " << v << " channel " << c;
}

TEST_F(SyntheticExposure, EqualPhotosStayUnchanged) {
  const SceneProfile profile = ProfileScene(MakeCapture(false), 2, "auto");
  EXPECT_FALSE(profile.effects.back().on) << EffectLine(profile.effects.back());
  // Measured, and nothing: the disagreement that is left is noise.
  EXPECT_LT(std::abs(*profile.effects.back().value.value), 0.02);
  EXPECT_GT(profile.exposure.spread, 0);
  EXPECT_TRUE(profile.gains.of_view.empty());
}

TEST_F(SyntheticExposure, OptionsOverrideMeasurements) {
  const Capture capture = MakeCapture(true);
  EXPECT_TRUE(ProfileScene(capture, 2, "exposure=off").gains.of_view.empty());
  Capture without = capture;
  without.points.clear();
  const SceneProfile off = ProfileScene(without, 2, "auto");
  EXPECT_FALSE(off.effects.back().on);
  EXPECT_NE(EffectLine(off.effects.back()).find("without points"), std::string::npos);
  EXPECT_THROW(ProfileScene(without, 2, "exposure=on"), Error);
  // Photos without a point between them keep their exposures, and are named.
  for (CaptureView& view : without.views) view.file = "photo of " + view.name;
  without.points.push_back(capture.points[0]);
  const SceneProfile asked_for = ProfileScene(without, 2, "exposure=on");
  EXPECT_EQ(asked_for.gains.Of(3), kAsTaken);
  ASSERT_EQ(asked_for.notices.size(), 1u);
  EXPECT_NE(asked_for.notices[0].find("photo of 00003.png"), std::string::npos);
}

TEST_F(SyntheticExposure, GainsAreUndoneOnReading) {
  const Capture capture = MakeCapture(false);
  const WorkingViews views(capture, 100, 0);
  const Image plain = views.Photo(0);
  PhotoGains gains;
  gains.of_view.assign(capture.views.size(), PhotoGain{{0.5, 1, 2}});
  const WorkingViews corrected = views.WithGains(gains);
  const Image undone = corrected.Photo(0);
  EXPECT_EQ(corrected.AsTaken().Photo(0).pixels, plain.pixels);
  EXPECT_EQ(plain.width, 100);
  for (int y = 0; y < plain.height; ++y)
    for (int x = 0; x < plain.width; ++x) {
      const float *before = plain.at(x, y), *after = undone.at(x, y);
      EXPECT_NEAR(LinearFromSrgb(after[0]), std::min(1.0, 2 * LinearFromSrgb(before[0])), 1e-5);
      EXPECT_NEAR(LinearFromSrgb(after[2]), LinearFromSrgb(before[2]) / 2, 1e-5);
    }
}

TEST(PhotoGains, ClippedValuesAreLowerBounds) {
  ExposureEstimate estimate;
  estimate.photos.resize(3);
  for (PhotoExposure& photo : estimate.photos) photo.known = true;
  estimate.photos[0].gain = {2, 2, 2};
  estimate.photos[1].gain = {0.5, 0.5, 0.5};
  estimate.photos[2].gain = {0.8, 0.8, 0.8};
  const auto white_undone = [&](const Vec3d& in_dark) {
    Image photo(1, 1);
    for (float& value : photo.pixels) value = 1;
    UndoGain(GainsOf(estimate, {{0.2, 0.2, 0.2}, in_dark, in_dark}).Of(0), &photo);
    return photo.pixels[0];
  };
  // Where dark photos clip nothing, what was clipped lay just above; where they clip as much,
  // it is a lamp or the sky; and between in between.
  EXPECT_NEAR(white_undone({0, 0, 0}), SrgbFromLinear(0.5), 1e-6);
  EXPECT_FLOAT_EQ(white_undone({0.2, 0.2, 0.2}), 1);
  EXPECT_NEAR(white_undone({0.1, 0.1, 0.1}), (1 + SrgbFromLinear(0.5)) / 2, 1e-6);
  // What is not clipped stays what it was.
  Image photo(1, 1);
  for (float& value : photo.pixels) value = 0.9f;
  UndoGain(GainsOf(estimate, {{0.2, 0.2, 0.2}, {0.2, 0.2, 0.2}, {0.2, 0.2, 0.2}}).Of(0),
           &photo);
  EXPECT_NEAR(photo.pixels[1], SrgbFromLinear(LinearFromSrgb(0.9) / 2), 1e-6);
}

TEST(PhotoGains, PutBackIsTheInverse) {
  Image photo(4, 1);
  for (size_t i = 0; i < photo.pixels.size(); ++i)
    photo.pixels[i] = 0.05f * static_cast<float>(i + 1);
  const Image before = photo;
  const PhotoGain gain{{1.3, 0.8, 1}};
  UndoGain(gain, &photo);
  PutGain(gain, &photo);
  for (size_t i = 0; i < photo.pixels.size(); ++i)
    EXPECT_NEAR(photo.pixels[i], before.pixels[i], 1e-6);
}

TEST(PhotoGains, FalloffDarkensTheCornersAndIsUndone) {
  Image photo(65, 49);
  std::ranges::fill(photo.pixels, 0.5f);
  const Image before = photo;
  const PhotoGain gain{{1.2, 1, 1}, 0, {-0.5, -0.3}};
  PutGain(gain, &photo);
  const auto light = [&photo](int x, int y) { return LinearFromSrgb(photo.at(x, y)[1]); };
  EXPECT_NEAR(light(32, 24) / LinearFromSrgb(0.5f), 1, 1e-5);
  EXPECT_NEAR(light(0, 0) / LinearFromSrgb(0.5f), std::exp(-0.8), 0.03);
  EXPECT_NEAR(light(64, 48), light(0, 0), 1e-6);
  UndoGain(gain, &photo);
  for (size_t i = 0; i < photo.pixels.size(); ++i)
    EXPECT_NEAR(photo.pixels[i], before.pixels[i], 1e-6);
}

// Pixels that are left out stay left out, whatever the gain.
TEST(PhotoGains, NanStaysNan) {
  Image photo(1, 1);
  photo.pixels = {std::nanf(""), 0.5f, std::nanf("")};
  for (const double factor : {0.5, 2.0}) {
    PutGain({{factor, factor, factor}, 0.5}, &photo);
    UndoGain({{factor, factor, factor}, 0.5}, &photo);
    EXPECT_TRUE(std::isnan(photo.pixels[0]) && std::isnan(photo.pixels[2])) << factor;
    EXPECT_NEAR(photo.pixels[1], 0.5, 1e-6);
  }
}

TEST(PhotoGains, H155_AsTakenIsBitForBit) {
  Image photo(2, 1);
  for (size_t i = 0; i < photo.pixels.size(); ++i)
    photo.pixels[i] = 0.1f * static_cast<float>(i);
  photo.pixels[0] = 1.5f;  // would be clipped
  const Image before = photo;
  UndoGain(kAsTaken, &photo);
  EXPECT_EQ(photo.pixels, before.pixels);
  EXPECT_EQ(PhotoGains().Of(17), kAsTaken);
}

TEST(PhotoGains, AreStoredBesideThePoses) {
  const testing::TemporaryFolder folder;
  const std::string poses = folder.path(), file = poses + "/exposure.json";
  Capture capture;
  capture.views.resize(2);
  capture.views[0].file = "a.jpg", capture.views[1].file = "b.jpg";
  EXPECT_TRUE(ReadGains(poses, capture).of_view.empty());
  EXPECT_TRUE(StoredGainRows(poses).IsNull());

  ExposureEstimate estimate;
  estimate.photos.resize(2);
  estimate.photos[1].gain = {1.1, 0.9, 1 / 3.0};
  estimate.photos[1].known = true;
  PhotoGains gains = GainsOf(estimate, {{0.1, 0.1, 0.1}, {0.1, 0.1, 0.1}});
  WriteGains(poses, capture, estimate, gains);
  EXPECT_EQ(ReadJsonFile(file).At("schema").AsInt(), 1);
  EXPECT_EQ(StoredGainRows(poses).AsArray().size(), 2u);
  EXPECT_EQ(ReadGains(poses, capture).Of(0), kAsTaken);
  EXPECT_EQ(ReadGains(poses, capture).Of(1), (PhotoGain{{1.1, 0.9, 1 / 3.0}, 1}));
  for (PhotoGain& gain : gains.of_view) gain.falloff = {-0.25, 1 / 7.0};
  WriteGains(poses, capture, {}, gains);  // falloff without exposure
  EXPECT_EQ(ReadGains(poses, capture).of_view, gains.of_view);
  capture.views[1].file = "c.jpg";
  EXPECT_REGRADE_ERROR(ReadGains(poses, capture), ExitCode::kInput,
                       "--restart-from reconstruct");
  testing::WriteText(file, R"({"schema": 9, "photos": []})");
  EXPECT_REGRADE_ERROR(ReadGains(poses, capture), ExitCode::kInput, "schema 1");
  WriteGains(poses, capture, estimate, {});
  EXPECT_FALSE(fs::exists(file));
}

// Every other photo has 0.4 of the light. With --keep-exposure so have its frames, and what
// they are compared with. A tenth of the style leaves exposures as most of what can differ: in
// one exposure the ceiling would have 27 dB, the field of the 2D method's pictures and the
// linear map 20 dB, and both rows of photos two decibels less.
TEST(KeepExposure, WhatFramesAreComparedWithHasTheirExposures) {
  const testing::TemporaryFolder folder;
  testing::SyntheticPhotos photos{.width = 100, .height = 75, .pixels_a_point = 5};
  photos.effects.noise = false;
  testing::WriteSyntheticWorkspace(photos, folder / "s");
  for (int i = 0; i < photos.views; i += 2) {
    const std::string path = folder / ("s/images/" + FrameName(i));
    Image photo = ReadImage(path);
    ApplyGain(0.4, &photo);
    WritePng8(path, photo);
  }
  const auto run = [](const std::vector<std::string>& words,
                      const std::vector<std::string>& more) {
    testing::Said(testing::Joined(words, more));
  };
  run({"run",        folder / "s",
       "--style",    testing::SourceDir() + "/assets/style_sunset.png",
       "--out",      folder / "o",
       "--preset",   "draft",
       "--effects",  "exposure=on,view-dependence=off",
       "--device",   "cpu",
       "--controls", "field",
       "--gaps",     "1",
       "--strength", "0.1",
       "--page",     "off"},
      testing::TinyFlags("voxels"));
  const auto metrics = [&folder] {
    const JsonValue report = ReadJsonFile(folder / "o/styles/style_sunset/report.json");
    std::map<std::string, double> found;
    for (const JsonValue& row : report.At("fidelity").AsArray())
      if (const JsonValue& db = row.At("psnr_to_2d_db"); db.IsNumber())
        found[row.At("sequence").AsString()] = db.AsDouble();
    for (const char* name : {"psnr_to_2d_photos_db", "linear_map_psnr_to_2d_db"})
      found[name] = report.At("stages").At("evaluate").At(name).AsDouble();
    return found;
  };
  std::map<std::string, double> one = metrics();
  run({"render", folder / "o", "--keep-exposure"}, {});
  // Its voxels have no page.
  for (const std::vector<std::string>& page :
       {std::vector<std::string>{"page", folder / "o", "--out", folder / "p.html"},
        {"view", folder / "o"}})
    EXPECT_EQ(testing::ExitCodeOf(page), 3) << page[0];
  EXPECT_EQ(testing::ExitCodeOf({"render", folder / "o", "--page", "on"}), 2);
  std::map<std::string, double> kept = metrics();
  EXPECT_GT(kept["control_ceiling"], kept["styled"]);
  EXPECT_GT(kept["linear_map_psnr_to_2d_db"], kept["source"]);
  for (const char* name : {"control_field_2d", "photos_2d", "psnr_to_2d_photos_db"})
    EXPECT_NEAR(kept[name], one[name], 1.2) << name;
}

TEST(TrackColors, WindowIsTheMeanLightAroundAPoint) {
  Image photo(16, 16);
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 16; ++x)
      for (int c = 0; c < 3; ++c)  // light grows linearly to the right
        photo.at(x, y)[c] = static_cast<float>(SrgbFromLinear(0.2 + 0.02 * (x + 0.5)));
  Vec3d light;
  ASSERT_TRUE(WindowLight(photo, 7.3, 8.8, &light));
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(light[c], 0.2 + 0.02 * 7.3, 1e-6);
  EXPECT_FALSE(WindowLight(photo, 2.4, 8, &light));  // its window leaves the photo
  EXPECT_FALSE(WindowLight(photo, 8, 13.6, &light));
  photo.at(9, 8)[1] = 1;  // clipped
  EXPECT_FALSE(WindowLight(photo, 7.3, 8.8, &light));
  EXPECT_TRUE(WindowLight(photo, 5.3, 8.8, &light));
}

}  // namespace
}  // namespace regrade
