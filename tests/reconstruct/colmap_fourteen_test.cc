// Fourteen models that were tried with COLMAP 3.8's own reader: it hung on four, aborted on
// five and accepted three wrong ones. Ours reads the two valid ones and reports the error of
// each of the others.
#include <gtest/gtest.h>

#include <chrono>
#include <cstring>
#include <functional>
#include <limits>

#include "kernels/base/error.h"
#include "reconstruct/colmap/colmap_model.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::ReadText;
using testing::WriteText;

// A small model on disk to damage.
struct ModelFolder {
  ModelFolder() {
    model = testing::MakeSyntheticModel({.images = 3, .points = 4});
    Write();
  }
  void Write() const { WriteColmapModel(model, folder.path()); }
  template <typename T>
  void Patch(const std::string& name, size_t offset, T value) const {
    std::string bytes = ReadText(folder / name);
    ASSERT_LE(offset + sizeof(T), bytes.size());
    std::memcpy(bytes.data() + offset, &value, sizeof(T));
    WriteText(folder / name, bytes);
  }

  testing::TemporaryFolder folder;
  ColmapModel model;
};

// Byte offsets in images.bin: count, id, then quaternion; the name follows the camera's id.
constexpr size_t kQuaternion = 8 + 4, kName = 8 + 4 + 56 + 4;
constexpr uint64_t kHuge = uint64_t{1} << 60;

struct Case {
  const char* name;
  std::function<void(ModelFolder*)> damage;
  const char* refusal;  // a part of the message; empty: it is accepted
};

const Case kFourteen[] = {
    {"valid, from COLMAP", [](ModelFolder*) {}, ""},
    {"a NaN error",
     [](ModelFolder* m) {
       m->model.points[0].error = std::numeric_limits<double>::quiet_NaN();
       m->Write();
     },
     ""},
    {"2^60 cameras", [](ModelFolder* m) { m->Patch("cameras.bin", 0, kHuge); },
     "the count of cameras"},
    {"2^60 images", [](ModelFolder* m) { m->Patch("images.bin", 0, kHuge); },
     "the count of images"},
    {"2^60 points", [](ModelFolder* m) { m->Patch("points3D.bin", 0, kHuge); },
     "the count of points"},
    {"2^59 keypoints in an image",
     [](ModelFolder* m) { m->Patch("images.bin", kName + 10, kHuge / 2); }, "keypoints"},
    {"a file that ends inside an image name",
     [](ModelFolder* m) {
       WriteText(m->folder / "images.bin",
                 ReadText(m->folder / "images.bin").substr(0, kName) + std::string(30, 'x'));
       m->Patch("images.bin", 0, uint64_t{1});
     },
     "the file ends inside an image name"},
    {"three empty files",
     [](ModelFolder* m) {
       for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"})
         WriteText(m->folder / name, "");
     },
     "ends inside a count"},
    {"an empty points3D.bin, as after a full disk",
     [](ModelFolder* m) { WriteText(m->folder / "points3D.bin", ""); }, "ends inside a count"},
    {"an unknown camera model",
     [](ModelFolder* m) { m->Patch("cameras.bin", 8 + 4, int32_t{77}); },
     "unknown camera model 77"},
    {"an image with an unknown camera",
     [](ModelFolder* m) {
       m->model.images[1].camera_id = 9;
       m->Write();
     },
     "refers to camera 9"},
    {"a rotation of NaNs",
     [](ModelFolder* m) {
       for (size_t i = 0; i < 4; ++i)
         m->Patch("images.bin", kQuaternion + 8 * i, std::numeric_limits<double>::quiet_NaN());
     },
     "a quaternion is not a finite number"},
    {"a rotation of zeros",
     [](ModelFolder* m) {
       for (size_t i = 0; i < 4; ++i) m->Patch("images.bin", kQuaternion + 8 * i, 0.0);
     },
     "a rotation quaternion of length 0"},
    {"names that are paths",
     [](ModelFolder* m) {
       m->model.images[0].name = "/etc/passwd";
       m->model.images[1].name = "../../x.jpg";
       m->Write();
     },
     "names"},  // see below
};

TEST(ColmapFourteen, M1_F58_F59_F62_F63_EachIsReadOrRefused) {
  for (const Case& c : kFourteen) {
    SCOPED_TRACE(c.name);
    ModelFolder model;
    c.damage(&model);
    const auto begin = std::chrono::steady_clock::now();
    try {
      const ColmapModel read = ReadColmapModel(model.folder.path());
      if (std::string(c.refusal) == "names") {
        // Names are keys: only the third image has a photo and becomes a view.
        const Capture capture = CaptureFromModel(read, testing::PhotosOf(model.model));
        ASSERT_EQ(capture.views.size(), 1u);
        EXPECT_EQ(capture.views[0].path, "/photos/00002.png");
      } else {
        EXPECT_STREQ(c.refusal, "") << "it was accepted";
        EXPECT_EQ(read.images.size(), 3u);
      }
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::kInput);
      EXPECT_STRNE(c.refusal, "") << error.what();
      EXPECT_NE(std::string(error.what()).find(c.refusal), std::string::npos) << error.what();
    }
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
    EXPECT_LT(took.count(), 1) << "a refusal should be fast";
  }
}

}  // namespace
}  // namespace regrade
