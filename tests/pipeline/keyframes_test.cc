// camera_path.json: what is read, what is refused, and the camera between keyframes.
#include "pipeline/page/keyframes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "pipeline/files/json_file.h"
#include "tests/support/expect_error.h"
#include "tests/support/keyframes.h"

namespace regrade {
namespace {

using testing::SomeKeyframes;

KeyframePath Parse(const JsonValue& json) {
  return ParseKeyframePath(DumpJson(json), "path.json");
}

TEST(Keyframes, ThePathPassesThroughThem) {
  const KeyframePath path = Parse(SomeKeyframes());
  ASSERT_EQ(path.keyframes.size(), 4u);
  EXPECT_EQ(path.fps, 24);
  EXPECT_EQ(path.Seconds(), 5.5);
  for (const Keyframe& key : path.keyframes) {
    const Keyframe at = path.At(key.time);
    // Sums of a few numbers of the size of 1, and a scaling to unit length.
    EXPECT_LT(Norm(at.eye - key.eye), 1e-12);
    EXPECT_LT(Norm(at.forward - key.forward), 1e-12);
    EXPECT_LT(Norm(at.up - key.up), 1e-12);
    EXPECT_EQ(at.weights, key.weights);
    EXPECT_NEAR(Norm(key.forward), 1, 1e-15);
  }
  const Keyframe before = path.At(-1), after = path.At(99);
  EXPECT_EQ(before.eye, path.keyframes[0].eye);
  EXPECT_LT(Norm(after.eye - path.keyframes[3].eye), 1e-12);
}

// On a straight line at even places Catmull and Rom's curve is the line, in its middle
// interval.
TEST(Keyframes, BetweenEvenPlacesOfALineItIsTheLine) {
  JsonValue json = SomeKeyframes();
  for (int i = 0; i < 4; ++i)
    json["keyframes"] = [&] {
      JsonValue::Array keys = json.At("keyframes").AsArray();
      keys[static_cast<size_t>(i)]["eye"] = JsonValue::Array{double(i), 2.0 * i, -0.5 * i};
      return JsonValue(std::move(keys));
    }();
  const KeyframePath path = Parse(json);
  const double from = path.keyframes[1].time, to = path.keyframes[2].time;
  for (const double t : {0.1, 0.5, 0.75}) {
    const Vec3d eye = path.At((1 - t) * from + t * to).eye;
    EXPECT_LT(Norm(eye - Vec3d{1 + t, 2 * (1 + t), -0.5 * (1 + t)}), 1e-12);
  }
}

TEST(Keyframes, OppositeDirectionsKeepAViewAtEveryMoment) {
  JsonValue json = SomeKeyframes();
  JsonValue::Array keys = json.At("keyframes").AsArray();
  keys.resize(2);
  keys[0]["forward"] = JsonValue::Array{1, 0, 0};
  keys[1]["forward"] = JsonValue::Array{-1, 0, 0};
  for (JsonValue& key : keys) key["up"] = JsonValue::Array{0, 0, 1};
  json["keyframes"] = std::move(keys);
  const KeyframePath path = Parse(json);
  for (int i = 0; i <= 100; ++i) {
    const Camera camera =
        CameraOfKeyframe(path.At(path.Seconds() * i / 100), 64, 48, NdcSpace());
    EXPECT_NEAR(Norm(camera.Forward()), 1, 1e-12) << i;
    EXPECT_NEAR(Dot(camera.Forward(), camera.Up()), 0, 1e-12) << i;
  }
}

TEST(Keyframes, ThePictureHasTheKeyframesAnglesOfView) {
  const KeyframePath path = Parse(SomeKeyframes());
  const Keyframe& key = path.keyframes[0];
  const Camera camera = CameraOfKeyframe(key, 800, 600, NdcSpace());  // 0.4 to 0.3
  double u = 0, v = 0;
  const Vec3d side = Normalized(Cross(key.forward, key.up));
  ASSERT_TRUE(camera.Project(key.eye + key.forward + side * 0.4, &u, &v));
  EXPECT_NEAR(u, 800, 1e-9);
  EXPECT_NEAR(v, 300, 1e-9);
  // Another shape lies between the whole of the view and what fills the picture.
  EXPECT_NEAR(CameraOfKeyframe(key, 800, 300, NdcSpace()).fx, std::sqrt(1000.0 * 500.0), 1e-9);
}

TEST(Keyframes, HostileFilesAreRefusedWithALineAndARemedy) {
  const auto refuse = [](const char* what, const std::function<void(JsonValue*)>& spoil) {
    JsonValue json = SomeKeyframes();
    spoil(&json);
    SCOPED_TRACE(what);
    EXPECT_REGRADE_ERROR(Parse(json), ExitCode::kInput, "path.json");
    EXPECT_REGRADE_ERROR(Parse(json), ExitCode::kInput, "save the path again");
  };
  const auto key = [](const char* member, JsonValue value) {
    return [member, value](JsonValue* json) {
      JsonValue::Array keys = json->At("keyframes").AsArray();
      keys[1][member] = value;
      (*json)["keyframes"] = std::move(keys);
    };
  };
  using Array = JsonValue::Array;
  refuse("a number", [](JsonValue* json) { *json = JsonValue(7); });
  refuse("another file", [](JsonValue* json) { (*json)["format"] = "x"; });
  refuse("another version", [](JsonValue* json) { (*json)["version"] = 2; });
  refuse("no styles", [](JsonValue* json) { (*json)["styles"] = JsonValue(); });
  refuse("no keyframes", [](JsonValue* json) { (*json)["keyframes"] = Array(); });
  refuse("1001 keyframes", [](JsonValue* json) {
    (*json)["keyframes"] = Array(1001, json->At("keyframes").AsArray()[0]);
  });
  refuse("17 styles", [](JsonValue* json) { (*json)["styles"] = Array(17, JsonValue("a")); });
  refuse("a rate of 0", [](JsonValue* json) { (*json)["frames_per_second"] = 0; });
  refuse("a time that falls", key("time", 0));
  refuse("an endless film", key("time", 1e9));
  refuse("two coordinates", key("eye", Array{0, 0}));
  refuse("a place far away", key("eye", Array{0, 0, 1e300}));
  refuse("a text", key("eye", "here"));
  refuse("no direction", key("forward", Array{0, 0, 0}));
  refuse("parallel directions", key("up", Array{0, 1, 0}));
  refuse("an angle of 0", key("half_width", 0));
  refuse("a missing weight", key("weights", Array{0.5}));
  refuse("a negative weight", key("weights", Array{-0.5, 0}));
  refuse("weights above 1", key("weights", Array{0.6, 0.6}));
  refuse("null", key("weights", JsonValue()));
}

}  // namespace
}  // namespace regrade
