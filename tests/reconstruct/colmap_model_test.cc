// Reader and writer of COLMAP models: round trips, and damaged files on which COLMAP's own
// reader hangs, aborts or returns nonsense.
#include "reconstruct/colmap/colmap_model.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>

#include "kernels/base/error.h"
#include "tests/support/data.h"
#include "tests/support/expect_error.h"
#include "tests/support/synthetic_model.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::MakeSyntheticModel;
using testing::PhotosOf;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// A folder with a small model whose bytes can be changed.
class ColmapModelFile : public ::testing::Test {
 protected:
  ColmapModelFile()
      : folder_((fs::temp_directory_path() / ("colmap_model_" + std::to_string(getpid())))
                    .string()) {
    fs::create_directories(folder_);
    model_ = MakeSyntheticModel({.images = 3, .points = 4});
    WriteColmapModel(model_, folder_);
  }
  ~ColmapModelFile() override { fs::remove_all(folder_); }

  std::string Bytes(const std::string& name) const {
    std::ifstream file(folder_ + "/" + name, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  void SetBytes(const std::string& name, const std::string& bytes) const {
    std::ofstream(folder_ + "/" + name, std::ios::binary | std::ios::trunc) << bytes;
  }
  template <typename T>
  void Patch(const std::string& name, size_t offset, T value) const {
    std::string bytes = Bytes(name);
    ASSERT_LE(offset + sizeof(T), bytes.size());
    std::memcpy(bytes.data() + offset, &value, sizeof(T));
    SetBytes(name, bytes);
  }

  void ExpectRefusal(const std::string& part) const {
    EXPECT_REGRADE_ERROR(ReadColmapModel(folder_), ExitCode::kInput, part);
  }
  void ExpectRewrittenRefusal(const std::string& part) const {
    WriteColmapModel(model_, folder_);
    ExpectRefusal(part);
  }

  std::string folder_;
  ColmapModel model_;
};

// Byte offsets in our small files.
constexpr size_t kCameraModel = 8 + 4, kCameraWidth = 8 + 8, kCameraFocal = 8 + 8 + 16;
constexpr size_t kImageQuaternion = 8 + 4, kImageCamera = 8 + 4 + 56,
                 kImageName = 8 + 4 + 56 + 4;

TEST_F(ColmapModelFile, RoundTripKeepsEveryNumber) {
  const ColmapModel read = ReadColmapModel(folder_);
  ASSERT_EQ(read.cameras.size(), 1u);
  ASSERT_EQ(read.images.size(), 3u);
  ASSERT_EQ(read.points.size(), 4u);
  EXPECT_EQ(read.cameras[0].lens, ColmapLens::kSimpleRadial);
  EXPECT_EQ(read.cameras[0].intrinsics.fy, 600);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(read.images[i].name, model_.images[i].name);
    EXPECT_EQ(read.images[i].camera_from_world.translation,
              model_.images[i].camera_from_world.translation);
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column)  // via a quaternion
        EXPECT_NEAR(read.images[i].camera_from_world.rotation(row, column),
                    model_.images[i].camera_from_world.rotation(row, column), 1e-15);
    EXPECT_EQ(read.images[i].keypoints[2].u, model_.images[i].keypoints[2].u);
  }
  EXPECT_EQ(read.points[3].position, model_.points[3].position);
  EXPECT_EQ(read.points[3].color, model_.points[3].color);
  EXPECT_EQ(read.points[3].track[1].image_id, 2u);
  // Writing a model that was read keeps the bytes, up to rounding of rotations.
  WriteColmapModel(read, folder_);
  const std::string images = Bytes("images.bin"), points = Bytes("points3D.bin");
  WriteColmapModel(ReadColmapModel(folder_), folder_);
  EXPECT_EQ(Bytes("points3D.bin"), points);
  EXPECT_EQ(Bytes("images.bin").size(), images.size());
}

TEST_F(ColmapModelFile, RotationsAreKeptByQuaternionsInEveryOctant) {
  // Half turns make each quaternion component zero in turn.
  const Mat3d turns[] = {{{{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}},
                         {{{-1, 0, 0}, {0, 1, 0}, {0, 0, -1}}},
                         {{{-1, 0, 0}, {0, -1, 0}, {0, 0, 1}}},
                         {{{0, -1, 0}, {1, 0, 0}, {0, 0, 1}}}};
  for (const Mat3d& turn : turns) {
    model_.images[0].camera_from_world.rotation = turn;
    WriteColmapModel(model_, folder_);
    const ColmapModel read = ReadColmapModel(folder_);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        EXPECT_NEAR(read.images[0].camera_from_world.rotation(i, j), turn(i, j), 1e-15);
  }
}

TEST_F(ColmapModelFile, F59_TruncatedAnywhereIsRefused) {
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) {
    const std::string whole = Bytes(name);
    for (size_t size = 0; size < whole.size(); ++size) {
      SetBytes(name, whole.substr(0, size));
      ASSERT_THROW(ReadColmapModel(folder_), Error) << name << " cut at " << size;
    }
    SetBytes(name, whole);
  }
  EXPECT_NO_THROW(ReadColmapModel(folder_));
}

TEST_F(ColmapModelFile, F58_HugeCountsTakeNoMemory) {
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"})
    for (const uint64_t count : {uint64_t{1} << 60, ~uint64_t{0}, uint64_t{1000}}) {
      const std::string whole = Bytes(name);
      Patch(name, 0, count);
      ExpectRefusal("the count of");
      SetBytes(name, whole);
    }
}

TEST_F(ColmapModelFile, F58_HugeTrackAndKeypointCounts) {
  const std::string images = Bytes("images.bin");
  Patch("images.bin", kImageName + 10, uint64_t{1} << 59);
  ExpectRefusal("keypoints");
  SetBytes("images.bin", images);
  Patch("points3D.bin", 8 + 8 + 24 + 3 + 8, uint64_t{1} << 60);
  ExpectRefusal("track elements");
}

TEST_F(ColmapModelFile, F59_FileEndsInsideAName) {
  SetBytes("images.bin", Bytes("images.bin").substr(0, kImageName + 4) + std::string(30, 'x'));
  Patch("images.bin", 0, uint64_t{1});
  ExpectRefusal("inside an image name");
}

TEST_F(ColmapModelFile, F59_NamesHaveALimit) {
  model_.images[0].name = std::string(4096, 'n');
  WriteColmapModel(model_, folder_);
  EXPECT_EQ(ReadColmapModel(folder_).images[0].name.size(), 4096u);
  model_.images[0].name += "n";
  ExpectRewrittenRefusal("longer than 4096");
}

TEST_F(ColmapModelFile, M1_ZeroBytes) {
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) SetBytes(name, "");
  ExpectRefusal("ends inside a count");
}

TEST_F(ColmapModelFile, F60_TrailingBytes) {
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) {
    const std::string whole = Bytes(name);
    SetBytes(name, whole + '\0');
    ExpectRefusal("1 bytes follow");
    SetBytes(name, whole);
  }
}

TEST_F(ColmapModelFile, MissingFileIsNamed) {
  fs::remove(folder_ + "/images.bin");
  ExpectRefusal("images.bin");
}

TEST_F(ColmapModelFile, F62_DuplicateIds) {
  const ColmapModel good = model_;
  model_.images[1].id = 1;
  ExpectRewrittenRefusal("occurs twice");
  model_ = good;
  model_.points[2].id = 1;
  ExpectRewrittenRefusal("occurs twice");
  model_ = good;
  model_.cameras.push_back(model_.cameras[0]);
  ExpectRewrittenRefusal("occurs twice");
  model_ = good;
  model_.images[1].name = model_.images[0].name;
  ExpectRewrittenRefusal("occurs twice");
}

TEST_F(ColmapModelFile, F62_DanglingIds) {
  const ColmapModel good = model_;
  model_.images[1].camera_id = 77;
  ExpectRewrittenRefusal("camera 77");
  model_ = good;
  model_.images[1].keypoints[0].point_id = 4711;
  ExpectRewrittenRefusal("point 4711");
  model_ = good;
  model_.points[1].track[0].image_id = 9;
  ExpectRewrittenRefusal("of image 9");
  model_ = good;
  model_.points[1].track[0].keypoint = 4;  // one past the last
  ExpectRewrittenRefusal("keypoint 4 of image 1");
}

TEST_F(ColmapModelFile, F63_NotFiniteNumbers) {
  const ColmapModel good = model_;
  model_.points[0].position.y = kNan;
  ExpectRewrittenRefusal("not a finite");
  model_ = good;
  model_.images[0].camera_from_world.translation.x = std::numeric_limits<double>::infinity();
  ExpectRewrittenRefusal("not a finite");
  model_ = good;
  model_.images[2].keypoints[1].u = kNan;
  ExpectRewrittenRefusal("not a finite");
  model_ = good;
  model_.cameras[0].intrinsics.distortion[0] = kNan;
  ExpectRewrittenRefusal("not a finite");
}

TEST_F(ColmapModelFile, H135_Quaternions) {
  const std::string whole = Bytes("images.bin");
  Patch("images.bin", kImageQuaternion, kNan);
  ExpectRefusal("not a finite");
  for (int i = 0; i < 4; ++i) Patch("images.bin", kImageQuaternion + 8 * i, 0.0);
  ExpectRefusal("image 1 has a rotation quaternion of length 0");
  Patch("images.bin", kImageQuaternion, 1.01);
  ExpectRefusal("length 1.01");
  // A small error of the length is corrected. A quarter turn about x, so that it matters.
  for (int i = 0; i < 2; ++i) Patch("images.bin", kImageQuaternion + 8 * i, 0.7075);
  const Mat3d rotation = ReadColmapModel(folder_).images[0].camera_from_world.rotation;
  EXPECT_NEAR(rotation.Determinant(), 1, 1e-14);
  EXPECT_NEAR(rotation(1, 2), -1, 1e-14);
}

TEST_F(ColmapModelFile, H134_ImplausibleCameras) {
  for (const double f : {0.0, -600.0, 1e9, 1.0}) {
    Patch("cameras.bin", kCameraFocal, f);
    ExpectRefusal("camera 1 has the focal length");
  }
  Patch("cameras.bin", kCameraFocal, 600.0);
  Patch("cameras.bin", kCameraFocal + 8, -1.0);
  ExpectRefusal("principal point outside");
  Patch("cameras.bin", kCameraFocal + 8, 320.0);
  for (const uint64_t width : {uint64_t{0}, uint64_t{1} << 40}) {
    Patch("cameras.bin", kCameraWidth, width);
    ExpectRefusal("picture size");
  }
  Patch("cameras.bin", kCameraWidth, uint64_t{640});
  Patch("images.bin", kImageQuaternion + 32, 1e300);
  ExpectRefusal("at infinity");
}

TEST_F(ColmapModelFile, H136_EveryCameraModelNumber) {
  // Parameters: focal lengths, centre, then 0.01, 0.02, ... in COLMAP's order.
  const struct {
    int lens, focals, coefficients;
    LensModel expected;
  } cases[] = {{0, 1, 0, LensModel::kPinhole},    {1, 2, 0, LensModel::kPinhole},
               {2, 1, 1, LensModel::kOpenCv},     {3, 1, 2, LensModel::kOpenCv},
               {4, 2, 4, LensModel::kOpenCv},     {5, 2, 4, LensModel::kFisheye},
               {6, 2, 8, LensModel::kFullOpenCv}, {8, 1, 1, LensModel::kFisheye},
               {9, 1, 2, LensModel::kFisheye}};
  for (const auto& c : cases) {
    std::string bytes;
    const auto add = [&](auto value) {
      bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
    };
    add(uint64_t{1}), add(uint32_t{1}), add(int32_t{c.lens}), add(uint64_t{640}),
        add(uint64_t{480});
    for (int i = 0; i < c.focals; ++i) add(600.0 + i);
    add(321.0), add(241.0);
    for (int i = 0; i < c.coefficients; ++i) add(0.01 * (i + 1));
    SetBytes("cameras.bin", bytes);
    const Camera camera = ReadColmapModel(folder_).cameras[0].intrinsics;
    EXPECT_EQ(camera.lens, c.expected) << c.lens;
    EXPECT_EQ(camera.fx, 600);
    EXPECT_EQ(camera.fy, c.focals == 2 ? 601 : 600);
    EXPECT_EQ(camera.cx, 321);
    EXPECT_EQ(camera.cy, 241);
    for (int i = 0; i < 8; ++i)
      EXPECT_EQ(camera.distortion[i], i < c.coefficients ? 0.01 * (i + 1) : 0) << c.lens;
    // Writing gives the same bytes.
    WriteColmapModel(ReadColmapModel(folder_), folder_);
    EXPECT_EQ(Bytes("cameras.bin"), bytes) << c.lens;
  }
  WriteColmapModel(model_, folder_);
  Patch("cameras.bin", kCameraModel, int32_t{7});
  ExpectRefusal("FOV");
  Patch("cameras.bin", kCameraModel, int32_t{10});
  ExpectRefusal("THIN_PRISM_FISHEYE");
  for (const int32_t unknown : {-1, 11, 77}) {
    Patch("cameras.bin", kCameraModel, unknown);
    ExpectRefusal("unknown camera model");
    ExpectRefusal(unknown < 0 ? "damaged" : "newer COLMAP");
  }
}

TEST_F(ColmapModelFile, F61_NamesAreKeysOnly) {
  const std::string path_out = "../../" + model_.images[0].name;  // not the photo's name
  model_.images[0].name = path_out;
  model_.images[1].name = "";
  WriteColmapModel(model_, folder_);
  const ColmapModel read = ReadColmapModel(folder_);
  const Capture capture = CaptureFromModel(read, PhotosOf(model_));
  ASSERT_EQ(capture.views.size(), 1u);  // only 00002.png has a photo with that name
  EXPECT_EQ(capture.views[0].path, "/photos/00002.png");
  EXPECT_EQ(capture.statuses[0].status, PhotoState::kUnregistered);
  EXPECT_EQ(capture.statuses.back().status, PhotoState::kSkipped);
}

TEST(CaptureFromModel, ViewsPointsAndErrors) {
  ColmapModel model = MakeSyntheticModel({.images = 4, .points = 20});
  model.images[1].keypoints[5].u += 3;  // one observation is off by a 3-4-5 triangle
  model.images[1].keypoints[5].v += 4;
  const Capture capture = CaptureFromModel(model, PhotosOf(model, 1));
  ASSERT_EQ(capture.views.size(), 4u);
  EXPECT_EQ(capture.views[2].name, "00002.png");
  EXPECT_EQ(capture.views[2].file, "IMG 2.jpg");
  EXPECT_EQ(capture.statuses[4].file, "IMG 4.jpg");
  EXPECT_EQ(capture.statuses[4].status, PhotoState::kUnregistered);
  ASSERT_EQ(capture.points.size(), 20u);
  EXPECT_EQ(capture.points[5].views, (std::vector<int32_t>{0, 1, 2, 3}));
  // The stored errors are -1; ours are means over observations.
  EXPECT_NEAR(capture.points[5].reprojection_error, 5.0 / 4, 1e-9);
  EXPECT_NEAR(capture.reprojection_px, 5.0 / 80, 1e-9);
  EXPECT_FLOAT_EQ(capture.points[5].color.x, 5 / 255.0f);
}

TEST(CaptureFromModel, H137_SizeMismatchIsRefused) {
  const ColmapModel model = MakeSyntheticModel({.images = 3});
  std::vector<StagedPhoto> photos = PhotosOf(model);
  std::swap(photos[1].width, photos[1].height);  // as with an ignored EXIF orientation
  EXPECT_REGRADE_ERROR(CaptureFromModel(model, photos), ExitCode::kInput,
                       "IMG 1.jpg: ", "480 x 640");
}

TEST(CaptureFromModel, UserNamesForForeignModels) {
  ColmapModel model = MakeSyntheticModel({.images = 3});
  for (int i = 0; i < 3; ++i) model.images[i].name = "IMG " + std::to_string(2 - i) + ".jpg";
  const std::vector<StagedPhoto> photos = PhotosOf(model);
  EXPECT_THROW(CaptureFromModel(model, photos), Error);  // it has no staged names
  const Capture capture = CaptureFromModel(model, photos, PhotoNames::kUser);
  ASSERT_EQ(capture.views.size(), 3u);
  EXPECT_EQ(capture.views[0].file, "IMG 0.jpg");
  // Views have the order of the photos: photo 0 is the model's last image.
  EXPECT_EQ(capture.views[0].camera.camera_from_world.rotation(0, 2),
            model.images[2].camera_from_world.rotation(0, 2));
}

TEST(ColmapModelData, FernComesWithoutImages) {
  REGRADE_NEED_DATA("llff_fern/sparse/0");
  EXPECT_REGRADE_ERROR(ReadColmapModel(testing::DataPath("llff_fern/sparse/0")),
                       ExitCode::kInput, "images.bin");
}

}  // namespace
}  // namespace regrade
