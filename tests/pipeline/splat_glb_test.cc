// Splats in binary glTF: what the format demands, and the picture.
#include "pipeline/fields/splat_glb.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "kernels/splats/render_picture.h"
#include "pipeline/files/json_file.h"
#include "tests/support/small_splats.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::ReadText;
using testing::TemporaryFolder;

// The splats of a GLB by its JSON, in its own axes, and what glTF demands of the file.
Splats SplatsOfGlb(const std::string& file) {
  const auto number = [&file](size_t at) {
    uint32_t value = 0;
    std::memcpy(&value, file.data() + at, 4);
    return value;
  };
  EXPECT_EQ(file.substr(0, 8), std::string("glTF\2\0\0\0", 8));
  EXPECT_EQ(number(8), file.size());
  const size_t size = number(12);
  EXPECT_EQ(file.substr(16, 4), "JSON");
  EXPECT_EQ(size % 4, 0u);
  const JsonValue json = ParseJson(file.substr(20, size), "test");
  EXPECT_EQ(file.substr(24 + size, 4), std::string("BIN\0", 4));
  EXPECT_EQ(28 + size + number(20 + size), file.size());
  EXPECT_EQ(static_cast<size_t>(json.At("buffers").AsArray()[0].At("byteLength").AsInt()),
            number(20 + size));
  const JsonValue& primitive = json.At("meshes").AsArray()[0].At("primitives").AsArray()[0];
  EXPECT_EQ(primitive.At("mode").AsInt(), 0);
  EXPECT_EQ(primitive.At("extensions").At("KHR_gaussian_splatting").At("colorSpace").AsString(),
            "srgb_rec709_display");
  const JsonValue::Array& accessors = json.At("accessors").AsArray();
  const auto values = [&](const std::string& name) {
    const JsonValue& accessor =
        accessors[static_cast<size_t>(primitive.At("attributes").At(name).AsInt())];
    const JsonValue& view =
        json.At("bufferViews")
            .AsArray()[static_cast<size_t>(accessor.At("bufferView").AsInt())];
    const size_t offset = static_cast<size_t>(view.At("byteOffset").AsInt()),
                 bytes = static_cast<size_t>(view.At("byteLength").AsInt());
    EXPECT_EQ(offset % 4, 0u);
    std::vector<float> floats(bytes / 4);
    std::memcpy(floats.data(), file.data() + 28 + size + offset, bytes);
    return floats;
  };
  const auto of = [&](const std::string& name) {
    return values("KHR_gaussian_splatting:" + name);
  };
  const std::vector<float> mean = values("POSITION"), rotation = of("ROTATION"),
                           scale = of("SCALE"), opacity = of("OPACITY");
  const size_t count = opacity.size();
  int basis = 0;
  std::vector<std::vector<float>> harmonics;
  for (const auto& [name, index] : primitive.At("attributes").AsObject())
    if (name.find(":SH_DEGREE_") != std::string::npos) {
      EXPECT_EQ(name,
                Concat("KHR_gaussian_splatting:SH_DEGREE_", static_cast<int>(std::sqrt(basis)),
                       "_COEF_", basis - static_cast<int>(std::pow(int(std::sqrt(basis)), 2))));
      harmonics.push_back(values(name));
      ++basis;
    }
  Splats splats(static_cast<int64_t>(count), basis);
  for (size_t i = 0; i < count; ++i) {
    Splat<float> splat;
    for (size_t a = 0; a < 3; ++a) {
      splat.mean[static_cast<int>(a)] = mean[3 * i + a];
      splat.log_scale[static_cast<int>(a)] = std::log(scale[3 * i + a]);
    }
    for (size_t a = 0; a < 4; ++a) splat.quaternion[(a + 1) % 4] = rotation[4 * i + a];
    splat.opacity_logit = std::log(opacity[i] / (1 - opacity[i]));
    splats.Set(static_cast<int64_t>(i), splat);
    for (size_t c = 0; c < 3; ++c)
      for (size_t k = 0; k < harmonics.size(); ++k)
        splats.sh[(3 * i + c) * harmonics.size() + k] = harmonics[k][3 * i + c];
  }
  const JsonValue& position =
      accessors[static_cast<size_t>(primitive.At("attributes").At("POSITION").AsInt())];
  for (size_t a = 0; a < 3; ++a) {
    float low = mean[a], high = mean[a];
    for (size_t i = a; i < mean.size(); i += 3)
      low = std::min(low, mean[i]), high = std::max(high, mean[i]);
    EXPECT_EQ(position.At("min").AsArray()[a].AsDouble(), low);
    EXPECT_EQ(position.At("max").AsArray()[a].AsDouble(), high);
  }
  return splats;
}

// As a program shows it whose cameras look along -z with y up: the same picture.
TEST(WriteSplatGlb, IsTheSamePictureForATurnedCamera) {
  const TemporaryFolder folder;
  for (const int basis : {1, 4, 9, 16}) {
    const Splats splats = testing::CastSplats<float>(testing::RandomSplats(60, basis, 5));
    WriteSplatGlb(folder / "a.glb", splats);
    Splats in_file = SplatsOfGlb(ReadText(folder / "a.glb"));
    ASSERT_EQ(in_file.basis, basis);
    ASSERT_EQ(in_file.count(), 60);
    in_file.background = splats.background;
    const Camera camera = testing::SplatCameraOf(61, 43);
    Camera turned = camera;
    for (int i = 0; i < 3; ++i)
      for (const int j : {1, 2}) turned.camera_from_world.rotation(i, j) *= -1;
    const auto a = RenderSplatsPlain(splats.view(), camera, {}),
               b = RenderSplatsPlain(in_file.view(), turned, {}),
               other = RenderSplatsPlain(in_file.view(), camera, {});
    double change = 0;
    for (size_t p = 0; p < a.color.size(); ++p) {
      // exp, log and the sigmoid round to floats, and the logit of one near 1 to 1e-6.
      ASSERT_NEAR(a.color[p], b.color[p], 1e-4) << p;
      change = std::max(change, double{std::abs(a.color[p] - other.color[p])});
    }
    EXPECT_GT(change, 0.1);  // the test can fail
  }
}

}  // namespace
}  // namespace regrade
