// styled.npz remade from field.npz and network.npz, after small runs of the program.
#include "tests/support/restyled_field.h"

#include <gtest/gtest.h>

#include "pipeline/stages/object_edit.h"
#include "tests/support/source_dir.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

using testing::ProgramOutcome;
using testing::ReadText;
using testing::RestyledField;
using testing::TemporaryFolder;

// Stylises a synthetic capture with further flags in folder / "e".
void Stylize(const TemporaryFolder& folder, const std::vector<std::string>& synth_flags,
             const std::vector<std::string>& flags) {
  std::vector<std::string> synth{"synth", folder / "s", "--views", "8", "--size", "96x72"};
  synth.insert(synth.end(), synth_flags.begin(), synth_flags.end());
  ASSERT_EQ(testing::RunProgram(REGRADE_PROGRAM, synth).code, 0);
  std::vector<std::string> run{"run",      folder / "s/truth",
                               "--out",    folder / "e",
                               "--style",  testing::SourceDir() + "/assets/style_sunset.png",
                               "--device", "cpu"};
  for (const std::string& flag : testing::TinyFlags()) run.push_back(flag);
  run.insert(run.end(), flags.begin(), flags.end());
  const ProgramOutcome outcome = testing::RunProgram(REGRADE_PROGRAM, run);
  ASSERT_EQ(outcome.code, 0) << outcome.text;
}

// The bytes of styled.npz, written again.
std::string Remade(const TemporaryFolder& folder, const std::vector<float>* object_weights) {
  WriteFieldFile(folder / "again.npz",
                 RestyledField(ReadFieldFile(folder / "e/field.npz"),
                               ReadNetworkFile(folder / "e/network.npz"), object_weights));
  return ReadText(folder / "again.npz");
}

// Background spheres, and the background colour that the scene's colour map changes.
TEST(RestyledField, IsTheFileOfTheRun) {
  const TemporaryFolder folder;
  Stylize(folder, {},
          {"--effects", "background=on", "--background-layers", "4", "--background-resolution",
           "16"});
  const StoredField source = ReadFieldFile(folder / "e/field.npz");
  EXPECT_TRUE(source.field.geometry->spheres.on());
  const Vec3f before = source.field.background,
              after = ReadNetworkFile(folder / "e/network.npz").background;
  EXPECT_FALSE(before.x == after.x && before.y == after.y && before.z == after.z);
  EXPECT_TRUE(Remade(folder, nullptr) == ReadText(folder / "e/styled.npz"));
}

TEST(RestyledField, WithObjectWeightsToo) {
  const TemporaryFolder folder;
  Stylize(folder, {"--effects", "masks"}, {"--masks", folder / "s/masks"});
  const int64_t voxels = ReadFieldFile(folder / "e/field.npz").field.geometry->num_voxels();
  const ObjectWeights weights = ReadObjectFile(folder / "e/object.npz", voxels);
  EXPECT_TRUE(Remade(folder, &weights.all) == ReadText(folder / "e/styled.npz"));
  EXPECT_FALSE(Remade(folder, nullptr) == ReadText(folder / "e/styled.npz"));
}

}  // namespace
}  // namespace regrade
