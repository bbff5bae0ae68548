// Synthetic captures on disk: complete, repeatable, and with exact ground truth.
#include "pipeline/capture/synth_capture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <vector>

#include "evaluate/flow_file.h"
#include "kernels/base/error.h"
#include "kernels/synthetic/ray_trace.h"
#include "pipeline/capture/synth_effects.h"
#include "pipeline/capture/transforms_json.h"
#include "pipeline/files/json_file.h"
#include "pipeline/images/image_file.h"
#include "reconstruct/colmap/colmap_model.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/threads.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

std::string Bytes(const fs::path& path) { return testing::ReadText(path.string()); }

class SynthCapture : public ::testing::Test {
 protected:
  // Writes a small capture and returns its folder.
  fs::path Write(const std::string& name, const std::string& effects = "",
                 const ProgressFunction& progress = {}, int views = 3) {
    WriteSyntheticCapture((root_ / name).string(),
                          {.views = views, .size = "64x48", .effects = effects}, progress);
    return root_ / name;
  }

  static std::map<std::string, std::string> AllBytes(const fs::path& folder) {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder))
      if (entry.is_regular_file())
        files[fs::relative(entry.path(), folder).string()] = Bytes(entry.path());
    return files;
  }

  const testing::TemporaryFolder folder_;
  const fs::path root_ = folder_.path();
};

TEST_F(SynthCapture, MasksAreOfOneObjectAndSomeAreWrong) {
  const fs::path with = Write("masked", "masks", {}, 6), plain = Write("plain", "", {}, 6);
  EXPECT_FALSE(fs::exists(plain / "masks"));
  EXPECT_EQ(Bytes(with / "images/00004.png"), Bytes(plain / "images/00004.png"));
  const auto covered = [&](const char* folder, int i) {
    char name[32];
    std::snprintf(name, sizeof name, "%05d.png", i);
    double sum = 0;
    for (const float m : ReadImage((with / folder / name).string()).pixels) sum += m;
    return sum;
  };
  for (int i = 0; i < 6; ++i) EXPECT_GT(covered("truth/masks", i), 20) << i;
  for (const int i : {0, 1, 4}) EXPECT_EQ(covered("masks", i), covered("truth/masks", i)) << i;
  EXPECT_EQ(covered("masks", 3), 0);
  EXPECT_GT(covered("masks", 5), 1.3 * covered("truth/masks", 5));
  EXPECT_NE(Bytes(with / "masks/00002.png"), Bytes(with / "truth/masks/00002.png"));
}

TEST_F(SynthCapture, WritesPhotosAndTruth) {
  const fs::path out = Write("a");
  std::vector<std::string> names;
  for (const auto& [name, bytes] : AllBytes(out)) names.push_back(name);
  const std::vector<std::string> expected = {"images/00000.png",
                                             "images/00001.png",
                                             "images/00002.png",
                                             "truth/depth/00000.npy",
                                             "truth/depth/00001.npy",
                                             "truth/depth/00002.npy",
                                             "truth/effects.json",
                                             "truth/flow/00000_00001.flo",
                                             "truth/flow/00001_00000.flo",
                                             "truth/flow/00001_00002.flo",
                                             "truth/flow/00002_00001.flo",
                                             "truth/transforms.json",
                                             "truth/visible/00000_00001.png",
                                             "truth/visible/00001_00000.png",
                                             "truth/visible/00001_00002.png",
                                             "truth/visible/00002_00001.png"};
  EXPECT_EQ(names, expected);
}

TEST_F(SynthCapture, WithoutFlowTheRestIsTheSame) {
  SynthOptions options{.scene = "street", .views = 4, .size = "32x24"};
  WriteSyntheticCapture((root_ / "with").string(), options);
  options.flow = false;
  WriteSyntheticCapture((root_ / "without").string(), options);
  for (const char* folder : {"truth/flow", "truth/visible"}) {
    EXPECT_TRUE(fs::exists(root_ / "with" / folder)) << folder;
    EXPECT_FALSE(fs::exists(root_ / "without" / folder)) << folder;
  }
  auto with = AllBytes(root_ / "with"), without = AllBytes(root_ / "without");
  EXPECT_NE(without.at("truth/effects.json").find("\"flow\""), std::string::npos);
  EXPECT_EQ(with.at("truth/effects.json").find("\"flow\""), std::string::npos);
  std::erase_if(with, [](const auto& file) {
    return file.first.starts_with("truth/flow/") || file.first.starts_with("truth/visible/");
  });
  with.erase("truth/effects.json");
  without.erase("truth/effects.json");
  EXPECT_EQ(with, without);
  // Photos with and without flow are not mixed.
  options.flow = true;
  EXPECT_THROW(WriteSyntheticCapture((root_ / "without").string(), options), Error);
}

TEST_F(SynthCapture, TruthOnDiskIsThatOfTheScene) {
  const fs::path out = Write("a");
  const SyntheticScene scene = MakeSyntheticScene("table", 0);
  const std::vector<Camera> cameras = SyntheticCameras(scene, 3, 64, 48);
  const TransformsFile file = ReadTransformsJson((out / "truth/transforms.json").string());
  ASSERT_EQ(file.frames.size(), 3u);
  EXPECT_EQ(file.frames[1].file, "../images/00001.png");
  EXPECT_TRUE(file.missing.empty());
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(file.frames[i].camera.fx, cameras[i].fx);
    EXPECT_LT(Norm(file.frames[i].camera.Center() - cameras[i].Center()), 1e-14);
  }
  const SyntheticView view = RenderSyntheticView(scene, cameras[1]);
  const std::string npy = Bytes(out / "truth/depth/00001.npy");
  const size_t size = view.depth.pixels.size() * sizeof(float);
  ASSERT_GT(npy.size(), size);
  EXPECT_EQ(npy.substr(0, 6), "\x93NUMPY");
  EXPECT_EQ(std::memcmp(npy.data() + npy.size() - size, view.depth.pixels.data(), size), 0);
  const FlowField flow = ReadFlowFile((out / "truth/flow/00001_00002.flo").string());
  EXPECT_EQ(flow.uv, TrueMotion(scene, cameras[1], cameras[2]).uv);
}

// What the evaluator needs at its default gaps, in both directions.
TEST_F(SynthCapture, MotionIsThatOfBothGapsAndDirections) {
  const fs::path flow = Write("a", "", {}, 7) / "truth/flow";
  const SyntheticScene scene = MakeSyntheticScene("table", 0);
  const std::vector<Camera> cameras = SyntheticCameras(scene, 7, 64, 48);
  int files = 0;
  for (const int gap : {1, 5})
    for (int i = 0; i + gap < 7; ++i)
      for (const auto& [from, to] : {std::pair{i, i + gap}, {i + gap, i}}) {
        EXPECT_EQ(ReadFlowFile((flow / FlowFileName(from, to)).string()).uv,
                  TrueMotion(scene, cameras[static_cast<size_t>(from)],
                             cameras[static_cast<size_t>(to)])
                      .uv)
            << from << " " << to;
        ++files;
      }
  EXPECT_EQ(std::distance(fs::directory_iterator(flow), {}), files);
}

TEST_F(SynthCapture, SameBytesForAnyNumberOfThreadsAndEveryTime) {
  const auto with_threads = [&](int n, const char* name) {
    const testing::Threads threads(n);
    return AllBytes(Write(name, "exposure,noise,distortion,highlights"));
  };
  const auto one = with_threads(1, "one"), three = with_threads(3, "three");
  EXPECT_EQ(one, three);
  EXPECT_EQ(three, AllBytes(Write("three", "exposure,noise,distortion,highlights")));
}

// Each effect changes only its own files.
TEST_F(SynthCapture, EffectsThatAreOffLeaveNoTrace) {
  const auto plain = AllBytes(Write("plain"));
  for (const char* effect : {"exposure", "noise", "highlights", "distortion"}) {
    const auto with = AllBytes(Write(effect, effect));
    EXPECT_NE(with.at("images/00001.png"), plain.at("images/00001.png")) << effect;
    EXPECT_NE(with.at("truth/effects.json"), plain.at("truth/effects.json")) << effect;
    const bool moves = std::string(effect) == "distortion";
    for (const char* name : {"truth/transforms.json", "truth/depth/00001.npy",
                             "truth/flow/00000_00001.flo", "truth/visible/00000_00001.png"})
      EXPECT_EQ(with.at(name) != plain.at(name), moves) << effect << " " << name;
  }
}

TEST_F(SynthCapture, EachEffectRecordsItsParameters) {
  const fs::path out = Write("all", "exposure,noise,distortion,highlights");
  const JsonValue effects = ReadJsonFile((out / "truth/effects.json").string()).At("effects");
  const JsonValue::Array& gains = effects.At("exposure").At("gains").AsArray();
  ASSERT_EQ(gains.size(), 3u);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(gains[i].AsDouble(), SynthGain(0, i, 3));
  EXPECT_EQ(effects.At("noise").At("sigma").AsDouble(), 2.0 / 255);
  EXPECT_EQ(effects.At("distortion").At("k1").AsDouble(), -0.1);
  EXPECT_EQ(effects.At("distortion").At("k2").AsDouble(), 0.02);
  EXPECT_EQ(effects.At("highlights").At("exponent").AsDouble(), 60);
  const Camera camera =
      ReadTransformsJson((out / "truth/transforms.json").string()).frames[0].camera;
  EXPECT_EQ(camera.lens, LensModel::kOpenCv);
  EXPECT_EQ(camera.distortion[0], -0.1);

  const fs::path plain = Write("plain");
  const JsonValue none = ReadJsonFile((plain / "truth/effects.json").string()).At("effects");
  for (const char* name : {"exposure", "noise", "distortion", "highlights"})
    EXPECT_FALSE(none.At(name).At("on").AsBool());
}

// Tracks have noise of half a pixel, poses have the stated errors, and photos do not change.
TEST_F(SynthCapture, InaccuratePosesComeWithTracks) {
  const fs::path out = Write("poses", "poses", {}, 5), plain = Write("plain", "", {}, 5);
  EXPECT_EQ(Bytes(out / "images/00003.png"), Bytes(plain / "images/00003.png"));
  const ColmapModel model = ReadColmapModel((out / "sparse/0").string());
  const auto truth = ReadTransformsJson((out / "truth/transforms.json").string()).frames;
  ASSERT_EQ(model.images.size(), 5u);
  EXPECT_GT(model.points.size(), 200u);
  double squares = 0, turned = 0;
  int64_t count = 0;
  for (size_t v = 0; v < 5; ++v) {
    const Camera& camera = truth[v].camera;
    for (const ColmapKeypoint& keypoint : model.images[v].keypoints) {
      double x = 0, y = 0;
      ASSERT_TRUE(camera.Project(model.FindPoint(keypoint.point_id)->position, &x, &y));
      squares += (x - keypoint.u) * (x - keypoint.u) + (y - keypoint.v) * (y - keypoint.v);
      ++count;
    }
    const Mat3d turn = model.images[v].camera_from_world.rotation *
                       camera.camera_from_world.rotation.Transposed();
    const Vec3d sine{turn(2, 1) - turn(1, 2), turn(0, 2) - turn(2, 0), turn(1, 0) - turn(0, 1)};
    turned = std::asin(Norm(sine) / 2) * 180 / M_PI;
    EXPECT_NEAR(turned, kSynthPoseTurn, 1e-6) << v;
  }
  ASSERT_GT(count, 500);
  EXPECT_NEAR(std::sqrt(squares / static_cast<double>(count) / 2), kSynthTrackSigma, 0.05);
}

TEST_F(SynthCapture, GainsStayInRangeAndNoiseHasItsSigma) {
  double low = 2, high = 0;
  for (int i = 0; i < 24; ++i) {
    const double gain = SynthGain(0, i, 24);
    low = std::min(low, gain), high = std::max(high, gain);
  }
  EXPECT_GE(low, 0.7);
  EXPECT_LE(high, 1.3);
  EXPECT_LT(low, 0.85);
  EXPECT_GT(high, 1.15);

  Image grey(200, 200);
  for (float& value : grey.pixels) value = 0.5f;
  ApplyNoise(7, 0, kSynthNoiseSigma, &grey);
  double sum = 0, squares = 0;
  for (const float value : grey.pixels)
    sum += value - 0.5, squares += (value - 0.5) * (value - 0.5);
  const double n = static_cast<double>(grey.pixels.size());  // 120000
  // Four standard errors: of the mean sigma / sqrt(n), of sigma sigma / sqrt(2 n).
  EXPECT_NEAR(sum / n, 0, 4 * kSynthNoiseSigma / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(squares / n), kSynthNoiseSigma,
              4 * kSynthNoiseSigma / std::sqrt(2 * n));
}

TEST_F(SynthCapture, RefusesUnknownEffectsScenesAndSizes) {
  const auto refusal = [&](const SynthOptions& options) {
    const Error error =
        testing::ErrorFrom([&] { WriteSyntheticCapture((root_ / "never").string(), options); });
    EXPECT_EQ(error.code(), ExitCode::kUsage);
    return error.what_failed() + " | " + error.hint();
  };
  for (const char* effects :
       {"fog", "noise,,exposure", "noise ", "motion-blur", "occluders", "barrel,fisheye"}) {
    EXPECT_NE(refusal({.effects = effects}).find("masks, poses, mixed-cameras, and one lens"),
              std::string::npos);
  }
  for (const char* size : {"", "640", "640x", "x480", "640x480x3", "0x0", "8x8", "99999x2",
                           "-64x48", "99999999999x48", "640 x 480"})
    refusal({.size = size});
  EXPECT_NE(refusal({.scene = "garden"}).find("table|wall|room"), std::string::npos);
  EXPECT_FALSE(fs::exists(root_ / "never"));
}

TEST_F(SynthCapture, DoesNotMixWithOtherPhotos) {
  fs::create_directories(root_ / "mine" / "images");
  std::ofstream(root_ / "mine" / "images" / "holiday.jpg") << "x";
  EXPECT_REGRADE_ERROR(Write("mine"), ExitCode::kFolderInUse, "");
  Write("other");
  EXPECT_THROW(Write("other", "noise"), Error);
}

TEST_F(SynthCapture, StopsWhenAsked) {
  const auto stop_after_two = [](const Progress& p) {
    return p.done >= 2 ? LoopControl::kStop : LoopControl::kContinue;
  };
  EXPECT_THROW(Write("aborted", "", stop_after_two, 6), Interrupted);
  EXPECT_FALSE(fs::exists(root_ / "aborted" / "truth" / "transforms.json"));
}

}  // namespace
}  // namespace regrade
