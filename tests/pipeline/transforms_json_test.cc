// transforms.json: what is written reads back, other programs' dialects are understood, hostile
// files are refused with the place.
#include "pipeline/capture/transforms_json.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "kernels/base/error.h"
#include "kernels/synthetic/synthetic_scene.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

class TransformsJson : public ::testing::Test {
 protected:
  TransformsJson() {
    for (const char* name : {"a.png", "b.png", "c.jpg"})
      testing::WriteText(folder_ / name, "x");
  }
  std::string path() const { return folder_ / "transforms.json"; }
  TransformsFile Read(const std::string& text, const PictureSizeFunction& size_of = {}) {
    std::ofstream(path()) << text;
    return ReadTransformsJson(path(), size_of);
  }
  // Reads, expects kInput, returns the message.
  std::string Refusal(const std::string& text) {
    const Error error = testing::ErrorFrom([&] { Read(text); });
    EXPECT_EQ(error.code(), ExitCode::kInput) << error.what() << text.substr(0, 200);
    return error.what_failed() + " @ " + error.where();
  }

  const testing::TemporaryFolder folder_;
};

constexpr char kUnit[] = R"([[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]])";

std::string OneFrame(const std::string& top, const std::string& name = "a.png",
                     const std::string& matrix = kUnit) {
  return "{" + top + ",\n\"frames\":[{\"file_path\":\"" + name +
         "\",\"transform_matrix\":" + matrix + "}]}";
}
constexpr char kPlain[] = R"("fl_x":100,"w":64,"h":48)";

void ExpectSameCamera(const Camera& a, const Camera& b) {
  EXPECT_EQ(a.width, b.width);
  EXPECT_EQ(a.height, b.height);
  EXPECT_EQ(a.fx, b.fx);
  EXPECT_EQ(a.fy, b.fy);
  EXPECT_EQ(a.cx, b.cx);
  EXPECT_EQ(a.cy, b.cy);
  EXPECT_EQ(a.lens, b.lens);
  EXPECT_EQ(a.distortion, b.distortion);
  // The inverse is taken on the way out and on the way back: a few roundings.
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(a.camera_from_world.translation[i], b.camera_from_world.translation[i], 1e-14);
    for (int j = 0; j < 3; ++j)
      EXPECT_NEAR(a.camera_from_world.rotation(i, j), b.camera_from_world.rotation(i, j),
                  1e-15);
  }
}

TEST_F(TransformsJson, CamerasRoundTrip) {
  std::vector<Camera> cameras = SyntheticCameras(MakeSyntheticScene("room", 0), 3, 640, 480);
  for (const bool shared : {true, false}) {
    if (!shared) {
      cameras[0].lens = LensModel::kOpenCv;
      cameras[0].distortion = {-0.1, 0.02, 1e-4, -2e-4};
      cameras[1].lens = LensModel::kFisheye;
      cameras[1].distortion = {0.1, -0.02, 0.003, 1.0 / 3};
      cameras[2].lens = LensModel::kFullOpenCv;
      cameras[2].distortion = {0.1, -0.02, 0, 0, 0.01};
    }
    WriteTransformsJson(path(),
                        {{"a.png", cameras[0]}, {"b.png", cameras[1]}, {"c.jpg", cameras[2]}});
    const TransformsFile file = ReadTransformsJson(path());
    ASSERT_EQ(file.frames.size(), 3u);
    EXPECT_EQ(file.frames[2].file, "c.jpg");
    for (int i = 0; i < 3; ++i) ExpectSameCamera(file.frames[i].camera, cameras[i]);
  }
}

// The identity in OpenGL looks along -z with y up; 4 units up the z axis it sees the origin.
TEST_F(TransformsJson, OpenGlAxesBecomeOpenCv) {
  const Camera camera = Read(OneFrame(kPlain)).frames[0].camera;
  EXPECT_EQ(camera.Center(), (Vec3d{0, 0, 4}));
  EXPECT_EQ(camera.Forward(), (Vec3d{0, 0, -1}));
  EXPECT_EQ(camera.Up(), (Vec3d{0, 1, 0}));
  double u, v, depth;
  ASSERT_TRUE(camera.Project({1, 0.5, 0}, &u, &v, &depth));
  EXPECT_DOUBLE_EQ(u, 32 + 100 * 0.25);
  EXPECT_DOUBLE_EQ(v, 24 - 100 * 0.125);
  EXPECT_DOUBLE_EQ(depth, 4);
}

TEST_F(TransformsJson, BlenderDialect) {
  const TransformsFile file =
      Read(OneFrame(R"("camera_angle_x":1.5707963267948966)", "./a"),
           [](const std::string&, int* w, int* h) { *w = 800, *h = 600; });
  ASSERT_EQ(file.frames.size(), 1u);
  EXPECT_EQ(file.frames[0].file, "a.png");
  EXPECT_NEAR(file.frames[0].camera.fx, 400, 1e-9);
  EXPECT_NEAR(file.frames[0].camera.fy, 400, 1e-9);
  EXPECT_EQ(file.frames[0].camera.cy, 300);
}

TEST_F(TransformsJson, H134_ImplausibleCameras) {
  EXPECT_NE(Refusal(OneFrame(R"("fl_x":1e9,"w":64,"h":48)")).find("focal length"),
            std::string::npos);
  EXPECT_NE(Refusal(OneFrame(R"("fl_x":60,"cx":-5,"w":64,"h":48)")).find("principal point"),
            std::string::npos);
  // Without a size nobody can tell.
  const auto unknown = [](const std::string&, int* w, int* h) { *w = *h = 0; };
  EXPECT_EQ(Read(OneFrame(R"("fl_x":1e9)"), unknown).frames.size(), 1u);
}

TEST_F(TransformsJson, MissingPicturesAreNamed) {
  const std::string frame = std::string(R"(","transform_matrix":)") + kUnit + "}";
  const TransformsFile file =
      Read("{" + std::string(kPlain) + R"(,"frames":[{"file_path":"gone.png)" + frame +
           R"(,{"file_path":"b.png)" + frame + "]}");
  EXPECT_EQ(file.missing, std::vector<std::string>{"gone.png"});
  ASSERT_EQ(file.frames.size(), 1u);
  EXPECT_NE(Refusal(OneFrame(kPlain, "gone.png")).find("gone.png"), std::string::npos);
}

TEST_F(TransformsJson, RoundedRotationsAreMadeOrthonormal) {
  const Camera camera =
      Read(OneFrame(kPlain, "a.png",
                    "[[0.8001,-0.6,0,0],[0.6,0.7999,0,0],[0,0,1.0002,0],[0,0,0,1]]"))
          .frames[0]
          .camera;
  const Mat3d& r = camera.camera_from_world.rotation;
  const Mat3d gram = r * r.Transposed();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) EXPECT_NEAR(gram(i, j), i == j, 1e-15);
}

TEST_F(TransformsJson, F75_HostileJson) {
  // Depth: a bracket for each of a million levels must not reach the stack's end.
  const std::string deep = Refusal("{\"frames\":" + std::string(1000000, '['));
  EXPECT_NE(deep.find("transforms.json:1:"), std::string::npos) << deep;
  EXPECT_NE(deep.find("64"), std::string::npos) << deep;
  EXPECT_NE(Refusal("{\n\"frames\":[],\n\"frames\":[]}").find(":3:"), std::string::npos);
  Refusal(OneFrame(kPlain, "\xff\xfe.png"));
  Refusal(OneFrame(kPlain, "\\ud800.png"));
  // Cut at the NUL it would be the name of a picture that is there.
  EXPECT_EQ(Refusal(OneFrame(kPlain, "a.png\\u0000.jpg")).find("none"), std::string::npos);
  Refusal(OneFrame(R"("fl_x":1e999,"w":64,"h":48)"));
  Refusal(OneFrame(R"("fl_x":NaN,"w":64,"h":48)"));
  Refusal("{\"frames\":[");
  Refusal("");
  Refusal("[1,2]");
  Refusal("{\"frames\":{}}");
  Refusal("{\"frames\":[]}");
  Refusal("{\"frames\":[null, 7, \"x\"]}");
}

TEST_F(TransformsJson, ValuesOutOfRangeAreRefusedWithTheLine) {
  EXPECT_NE(Refusal(OneFrame(R"("fl_x":0,"w":64,"h":48)")).find("focal"), std::string::npos);
  Refusal(OneFrame(R"("fl_x":-5,"w":64,"h":48)"));
  Refusal(OneFrame(R"("fl_x":"wide","w":64,"h":48)"));
  Refusal(OneFrame(R"("w":64,"h":48)"));
  Refusal(OneFrame(R"("fl_x":100)"));
  for (const char* side : {"0", "-3", "63.5", "1e9", "1e300", "true"})
    Refusal(OneFrame(std::string(R"("fl_x":100,"h":48,"w":)") + side));
  for (const char* matrix : {"[]", "7", "[[1,0,0,0],[0,1,0,0]]", "[[1,0,0],[0,1,0],[0,0,1]]",
                             "[[1,0,0,0],[0,1,0,0],[0,0,\"1\",0],[0,0,0,1]]",
                             "[[2,0,0,0],[0,2,0,0],[0,0,2,0],[0,0,0,1]]",     // scaled
                             "[[1,0,0,0],[0,1,0,0],[0,0,-1,0],[0,0,0,1]]",    // mirrored
                             "[[0,0,0,0],[0,0,0,0],[0,0,0,0],[0,0,0,1]]"}) {  // nothing
    EXPECT_NE(Refusal(OneFrame(kPlain, "a.png", matrix)).find("transforms.json:2:"),
              std::string::npos);
  }
  Refusal(OneFrame(std::string(R"("camera_model":"EQUIRECTANGULAR",)") + kPlain));
  Refusal(OneFrame(std::string(R"("k4":0.1,)") + kPlain));
  const std::string frame =
      std::string(R"({"file_path":"a.png","transform_matrix":)") + kUnit + "}";
  EXPECT_NE(Refusal("{" + std::string(kPlain) + ",\"frames\":[" + frame + "," + frame + "]}")
                .find("twice"),
            std::string::npos);
}

TEST_F(TransformsJson, LensesThatTheFormatCannotExpressAreRefused) {
  Camera camera = SyntheticCameras(MakeSyntheticScene("wall", 0), 1, 64, 48)[0];
  camera.lens = LensModel::kFullOpenCv;
  camera.distortion[5] = 0.1;
  EXPECT_THROW(WriteTransformsJson(path(), {{"a.png", camera}}), Error);
  EXPECT_FALSE(fs::exists(path()));
}

}  // namespace
}  // namespace regrade
