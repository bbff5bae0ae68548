// Each effect through the built program: what it gains where the scene calls for it, and that
// nothing is left of it where the scene does not.
#include <gtest/gtest.h>

#include <cstdlib>

#include "kernels/base/hash.h"
#include "kernels/field/cpu/rays.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/field/render.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/workspace/output_names.h"
#include "reconstruct/colmap/colmap_model.h"
#include "tests/support/nightly.h"
#include "tests/support/run_program.h"
#include "tests/support/synthetic_photos.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::SyntheticPhotos;
using testing::TemporaryFolder;
using testing::WriteSyntheticWorkspace;

struct Reconstruction {
  StoredField stored;
  JsonValue metrics;

  double heldout_db() const { return metrics.At("psnr_heldout_db").AsDouble(); }
  const JsonValue& effect(const std::string& name) const {
    for (const JsonValue& row : metrics.At("effects").AsArray())
      if (row.At("name").AsString() == name) return row;
    throw std::out_of_range(name);
  }
};

const std::vector<std::string> kVoxels = {
    "--field", "voxels", "--config",
    R"({"fit-rays": 2048, "fit-resolutions": [24, 48], "fit-steps": [100, 150]})"};
const std::vector<std::string> kSplats = {"--splat-steps", "400", "--splats", "4"};

// `regrade reconstruct --reproducible`, at sizes of seconds.
Reconstruction Reconstruct(const std::string& capture, const std::string& out,
                           const std::vector<std::string>& size,
                           const std::vector<std::string>& more = {}) {
  std::vector<std::string> words{"reconstruct", capture, "--out", out, "--reproducible"};
  words.insert(words.end(), size.begin(), size.end());
  words.insert(words.end(), more.begin(), more.end());
  testing::Said(words);
  return {ReadFieldFile(out + "/field.npz"),
          ReadJsonFile(out + "/.regrade/stages/reconstruct.json").At("metrics")};
}

template <typename T>
void Add(const Buffer<T>& values, Hasher* hasher) {
  hasher->Add(values.data(), static_cast<size_t>(values.size()) * sizeof(T));
}

// Of the field, and of a render from the first photo's place.
std::string DigestOf(const StoredField& stored, const Camera& camera) {
  Hasher hasher;
  Add(stored.field.geometry->links, &hasher);
  Add(stored.field.geometry->density, &hasher);
  Add(stored.field.appearance.sh, &hasher);
  const RenderedView view =
      RenderView(stored.field, WorkingCamera(camera, 96, stored.field_from_world, stored.ndc),
                 stored.field.march);
  hasher.Add(view.color.pixels.data(), view.color.pixels.size() * sizeof(float));
  return HashText(hasher.Value());
}

// Recorded of the program before exposure was an effect of it. They hold for one compiler, one
// instruction set and one C library; a change of the fit or of rendering changes them, too, and
// then they are recorded anew: with REGRADE_DIGESTS=print in the environment the test prints
// what it found, of a build whose only difference is that change.
constexpr char kDigestPhotos[] = "79c3bcff9820f832";
constexpr char kDigestField[] = "966c0aaaa3442581";

TEST(EffectsOff, H155_ResultsAreThoseWithoutThem) {
#if !defined(NDEBUG) || !defined(__GNUC__) || defined(__clang__) || __GNUC__ != 12
  GTEST_SKIP() << "digests are those of a release build by g++ 12";
#endif
  if (std::string(FastRays().name) != "avx512")
    GTEST_SKIP() << "digests are those of AVX-512, this is " << FastRays().name;
  TemporaryFolder folder;
  const SyntheticPhotos photos{.views = 9, .width = 96, .height = 72, .pixels_a_point = 4};
  WriteSyntheticWorkspace(photos, folder / "capture");
  Hasher of_photos;
  for (int i = 0; i < photos.views; ++i)
    of_photos.Add(testing::ReadText(folder / ("capture/images/" + FrameName(i))));
  const Camera camera = SyntheticCameras(MakeSyntheticScene(photos.scene, photos.seed),
                                         photos.views, photos.width, photos.height)[0];
  const Reconstruction measured = Reconstruct(folder / "capture", folder / "measured", kVoxels);
  const std::string digest = DigestOf(measured.stored, camera);
  if (std::getenv("REGRADE_DIGESTS") != nullptr) {
    std::printf("kDigestPhotos[] = \"%s\"\nkDigestField[] = \"%s\"\n",
                HashText(of_photos.Value()).c_str(), digest.c_str());
    if (std::getenv("REGRADE_DIGESTS") != std::string("print"))
      WriteSyntheticWorkspace(photos, std::getenv("REGRADE_DIGESTS"));
    return;
  }
  if (HashText(of_photos.Value()) != kDigestPhotos)
    GTEST_SKIP() << "another C library: its photos differ in the last bit already";
  // Measured, decided against, and nothing is left of it.
  EXPECT_FALSE(measured.effect("exposure").At("on").AsBool());
  EXPECT_EQ(measured.metrics.Find("exposure"), nullptr);
  EXPECT_EQ(digest, kDigestField);
  const Reconstruction refused = Reconstruct(
      folder / "capture", folder / "refused", kVoxels,
      {"--effects", "exposure=off,ndc=off,alpha=off,view-dependence=on,pose-refinement=off"});
  EXPECT_EQ(DigestOf(refused.stored, camera), kDigestField);
}

// Poses 0.3 degrees and 0.5 % of the spread off, tracks exact to half a pixel.
TEST(EffectsOn, RefinedPosesGainDecibels) {
  TemporaryFolder folder;
  testing::Said({"synth", folder / "capture", "--views", "16", "--size", "240x180", "--effects",
                 "poses"});
  const std::string others = "exposure=off,view-dependence=on";
  const Reconstruction on =
      Reconstruct(folder / "capture", folder / "on", kSplats, {"--effects", others});
  const Reconstruction off = Reconstruct(folder / "capture", folder / "off", kSplats,
                                         {"--effects", others + ",pose-refinement=off"});
  EXPECT_GT(on.heldout_db(), off.heldout_db() + 1.5) << on.heldout_db();
  const auto pose = [&folder](const char* name) {
    return ReadJsonFile(folder / (std::string(name) + "/.regrade/stages/pose.json"))
        .At("metrics");
  };
  EXPECT_TRUE(pose("on").At("effects").AsArray()[0].At("on").AsBool());
  EXPECT_NEAR(pose("on").At("pose_refinement").At("turned_deg").AsDouble(), 0.3, 0.05);
  // H155: off, the poses are those that came, but for a quaternion's rounding, and nothing else
  // speaks of it.
  EXPECT_FALSE(pose("off").At("effects").AsArray()[0].At("on").AsBool());
  EXPECT_EQ(pose("off").Find("pose_refinement"), nullptr);
  for (const char* part : {"cameras.bin", "points3D.bin"})
    EXPECT_TRUE(testing::ReadText(folder / (std::string("off/poses/sparse/") + part)) ==
                testing::ReadText(folder / (std::string("capture/sparse/0/") + part)))
        << part;
  const ColmapModel given = ReadColmapModel(folder / "capture/sparse/0"),
                    without = ReadColmapModel(folder / "off/poses/sparse"),
                    with = ReadColmapModel(folder / "on/poses/sparse");
  for (size_t v = 0; v < given.images.size(); ++v) {
    const Vec3d t = given.images[v].camera_from_world.translation;
    EXPECT_EQ(without.images[v].camera_from_world.translation, t);
    EXPECT_GT(Norm(with.images[v].camera_from_world.translation - t), 1e-3);
  }
}

const std::vector<std::string> kTrialless = {"--effects", "exposure=off,view-dependence=on"};

SyntheticPhotos Wall() {
  return {.scene = "wall", .views = 18, .width = 96, .height = 72, .pixels_a_point = 4};
}

// Its box does not depend on how much of it a lens shows.
SyntheticPhotos Table() {
  return {.views = 18, .width = 96, .height = 72, .pixels_a_point = 4};
}

// Photos whose exposure drifts by +-30 %. Held-out photos are compared with renders given the
// gain that those photos have by their own tracks.
TEST(EffectsOn, UndoneExposureGainsThreeDecibels) {
  TemporaryFolder folder;
  SyntheticPhotos photos = Wall();
  photos.effects.exposure = true;
  WriteSyntheticWorkspace(photos, folder / "capture");
  const Reconstruction on = Reconstruct(folder / "capture", folder / "on", kSplats,
                                        {"--effects", "view-dependence=on"});
  const Reconstruction off = Reconstruct(folder / "capture", folder / "off", kSplats,
                                         {"--effects", "exposure=off,view-dependence=on"});
  EXPECT_TRUE(on.effect("exposure").At("on").AsBool());
  EXPECT_FALSE(off.effect("exposure").At("on").AsBool());
  EXPECT_GT(on.heldout_db(), off.heldout_db() + 3) << on.heldout_db();
}

// The same scene through lenses that bend: followed, they cost no more than half a decibel (the
// parts of the scene that are seen differ, too), and taken for a pinhole they would cost many.
TEST(EffectsOn, BentLensesAreAsGoodAsAPinhole) {
  REGRADE_AT_NIGHT();
  TemporaryFolder folder;
  WriteSyntheticWorkspace(Table(), folder / "pinhole");
  const Reconstruction plain =
      Reconstruct(folder / "pinhole", folder / "plain", kSplats, kTrialless);
  EXPECT_FALSE(plain.effect("distortion").At("on").AsBool());
  for (const bool fisheye : {false, true}) {
    const std::string name = fisheye ? "fisheye" : "barrel";
    SyntheticPhotos photos = Table();
    (fisheye ? photos.effects.fisheye : photos.effects.barrel) = true;
    WriteSyntheticWorkspace(photos, folder / name);
    const Reconstruction bent =
        Reconstruct(folder / name, folder / (name + "_out"), kSplats, kTrialless);
    EXPECT_TRUE(bent.effect("distortion").At("on").AsBool());
    EXPECT_GT(bent.heldout_db(), plain.heldout_db() - 0.5) << name;
  }
}

}  // namespace
}  // namespace regrade
