// Measured depths: which maps are taken, and what is made of maps in another unit, with noise,
// outliers and holes, and of one that belongs to another photo.
#include "pipeline/capture/measured_depths.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "kernels/base/random.h"
#include "pipeline/capture/capture_source.h"
#include "pipeline/files/json_file.h"
#include "pipeline/images/image_file.h"
#include "tests/support/pictures.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr int kPhotoWidth = 64, kPhotoHeight = 48, kDepthViews = 5;

class MeasuredDepths : public ::testing::Test {
 protected:
  MeasuredDepths() {
    fs::create_directories(folder_ / "maps");
    for (int v = 0; v < kDepthViews; ++v) {
      const std::string name = Concat("0000", v, ".png");
      StagedPhoto photo;
      photo.file = Concat("photo", v, ".jpg");
      photo.name = name;
      photo.width = kPhotoWidth, photo.height = kPhotoHeight;
      photos_.push_back(photo);
      CaptureView view;
      view.file = photo.file;
      view.path = folder_ / ("poses/photos/" + name);
      view.camera.width = kPhotoWidth, view.camera.height = kPhotoHeight;
      view.camera.fx = view.camera.fy = 60;
      view.camera.cx = 32, view.camera.cy = 24;
      view.camera.camera_from_world.translation = {-0.1 * v, 0, 0};
      capture_.views.push_back(view);
    }
  }

  // The surface z = 2 + x / 4 of the world, along a ray from (0.1 view, 0, 0).
  static double SurfaceAt(int view, double x) { return (2 + 0.025 * view) / (1 - x / 4); }

  void AddPoints() {
    for (uint64_t k = 0; k < 200; ++k) {
      const double x = RandomDouble(1, 0, k) - 0.5, y = RandomDouble(1, 1, k) - 0.5;
      ScenePoint point;
      point.position = {x, y, 2 + x / 4};
      for (int v = 0; v < kDepthViews; ++v) point.views.push_back(v);
      capture_.points.push_back(point);
    }
  }

  // Half as large as the photos, in thousandths of `unit`.
  std::string WriteMap(int view, double unit, bool flat = false) {
    Image map = testing::ConstantImage(kPhotoWidth / 2, kPhotoHeight / 2, 0, 1);
    for (int y = 0; y < map.height; ++y)
      for (int x = 0; x < map.width; ++x) {
        const uint64_t pixel = static_cast<uint64_t>(y * map.width + x);
        double z = flat ? 7 : SurfaceAt(view, (2 * x + 1 - 32.0) / 60);
        z *= 1 + 0.01 * (RandomDouble(2, static_cast<uint64_t>(view), pixel) - 0.5);
        if (pixel % 23 == 0) z *= 2;  // outliers
        if (x < 6) z = 0;             // a hole
        map.at(x, y)[0] = static_cast<float>(std::round(1000 * unit * z) / 65535);
      }
    const std::string path = folder_ / Concat("maps/", view, ".png");
    WritePng16(path, map);
    return path;
  }

  std::vector<std::vector<SeenPoint>> Points(std::vector<std::string>* notes) const {
    std::vector<int> views;
    for (int v = 0; v < kDepthViews; ++v) views.push_back(v);
    Similarity twice;
    twice.scale = 2;
    return PointsOfViews(capture_, views, twice, notes);
  }

  std::string StagedFolder() const { return folder_ / "poses/depths"; }

  testing::TemporaryFolder folder_;
  std::vector<StagedPhoto> photos_;
  Capture capture_;
  std::vector<std::string> staged_notes_;
};

TEST_F(MeasuredDepths, OnlyMapsOf16BitsAndOneChannelAreTaken) {
  std::vector<std::string> maps(kDepthViews), notes;
  const auto stage = [&](double unit) {
    notes.clear();
    return StageDepths(maps, photos_, unit, StagedFolder(), &notes);
  };
  maps[1] = folder_ / "maps/one.png";
  const auto expect_left = [&](const std::string& why) {
    EXPECT_EQ(stage(1), 0);
    ASSERT_EQ(notes.size(), 1u);
    EXPECT_TRUE(notes[0].starts_with("1 depth map left out: one.png ")) << notes[0];
    EXPECT_NE(notes[0].find(why), std::string::npos) << notes[0];
  };
  testing::WriteText(maps[1], "no picture");
  expect_left("");
  WritePng8(maps[1], testing::ConstantImage(32, 24, 0.5f, 1));
  expect_left("not one channel of 16 bits");
  WritePng16(maps[1], testing::ConstantImage(32, 24, 0.5f, 3));
  expect_left("not one channel of 16 bits");
  WritePng16(maps[1], testing::ConstantImage(24, 24, 0.5f, 1));
  expect_left("");
  WritePng16(maps[1], testing::ConstantImage(32, 24, 0.5f, 1));
  EXPECT_EQ(stage(0.25), 1);
  EXPECT_EQ(notes[0], "1 map of measured depths: the fit takes them as points");
  std::map<std::string, std::string> found;
  double unit = 0;
  FindStagedDepths(StagedFolder(), &found, &unit);
  EXPECT_EQ(unit, 0.25);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found.begin()->first, "00001.png");
  maps[1] = "";
  EXPECT_EQ(stage(1), 0);
  EXPECT_TRUE(notes.empty());
  EXPECT_FALSE(fs::exists(StagedFolder()));
}

TEST_F(MeasuredDepths, AnotherUnitIsFoundAndAWrongMapIsLeftOutByName) {
  AddPoints();
  std::vector<std::string> maps;
  for (int v = 0; v < kDepthViews; ++v) maps.push_back(WriteMap(v, 1, v == 2));
  StageDepths(maps, photos_, 1, StagedFolder(),
              &staged_notes_);  // millimetres, said to be metres
  std::vector<std::string> notes;
  const std::vector<std::vector<SeenPoint>> seen = Points(&notes);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_NE(notes[0].find("times those of the points"), std::string::npos) << notes[0];
  EXPECT_TRUE(notes[0].ends_with(": photo2.jpg")) << notes[0];
  EXPECT_EQ(seen[2].size(), 200u);
  std::vector<double> errors;
  for (int v = 0; v < kDepthViews; ++v) {
    if (v == 2) continue;
    const std::vector<SeenPoint>& points = seen[static_cast<size_t>(v)];
    // Neither in the hole nor at its border or the map's, and fewer at outliers.
    EXPECT_GT(points.size(), 200u + 350);
    EXPECT_LT(points.size(), 200u + 25 * 22);
    for (size_t k = 200; k < points.size(); ++k) {
      const Vec3f& p = points[k].position;  // at twice the size
      errors.push_back(std::abs(double{p.z} / (4 + double{p.x} / 4) - 1));
      EXPECT_LT(points[k].sigma, 0.02f * p.z);
    }
  }
  std::ranges::sort(errors);
  EXPECT_LT(errors[errors.size() / 2], 0.005);
  EXPECT_LT(errors.back(), 0.03);  // outliers are no points: their neighbours differ
}

TEST_F(MeasuredDepths, WithoutPointsTheUnitIsWhatThePosesSay) {
  std::vector<std::string> maps(kDepthViews);
  maps[3] = WriteMap(3, 1);
  StageDepths(maps, photos_, 1e-3, StagedFolder(), &staged_notes_);
  std::vector<std::string> notes;
  const std::vector<std::vector<SeenPoint>> seen = Points(&notes);
  EXPECT_TRUE(seen[0].empty());
  ASSERT_GT(seen[3].size(), 300u);
  const Vec3f& p = seen[3][100].position;
  EXPECT_NEAR(p.z, 4 + p.x / 4, 0.1);
  EXPECT_NEAR(seen[3][100].sigma, 0.02 * double{p.z}, 1e-3);
  EXPECT_EQ(notes,
            std::vector<std::string>{"measured depths of 1 photo, with an error of 2.0 %"});
}

TEST_F(MeasuredDepths, TransformsNameThem) {
  WritePng8(folder_ / "0.png", testing::ConstantImage(kPhotoWidth, kPhotoHeight, 0.5f, 3));
  WriteMap(0, 1);
  JsonValue::Array rows;
  for (int i = 0; i < 4; ++i) {
    JsonValue::Array row(4, JsonValue(0.0));
    row[static_cast<size_t>(i)] = 1.0;
    rows.push_back(row);
  }
  JsonValue::Object top = {{"fl_x", 60.0}, {"w", kPhotoWidth}, {"h", kPhotoHeight}};
  top.emplace_back("depth_unit_scale_factor", 0.5);
  top.emplace_back("frames",
                   JsonValue::Array{JsonValue::Object{{"file_path", "0.png"},
                                                      {"depth_file_path", "maps/0.png"},
                                                      {"transform_matrix", rows}}});
  WriteJsonFile(folder_ / "transforms.json", top);
  const CaptureSource source = DetectCapture(folder_ / "");
  EXPECT_EQ(source.depth_unit, 0.5);
  ASSERT_EQ(source.depths.size(), 1u);
  EXPECT_EQ(source.depths.begin()->first, "0.png");
  EXPECT_TRUE(fs::equivalent(source.depths.begin()->second, folder_ / "maps/0.png"));
}

}  // namespace
}  // namespace regrade
