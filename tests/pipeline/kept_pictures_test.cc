// Pictures that are kept in memory are those of the files, to the bit.
#include "pipeline/images/kept_pictures.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "pipeline/images/image_file.h"
#include "tests/evaluate/synthetic_frames.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::TemporaryFolder;
using testing::WriteText;

TEST(KeptPictures, AreThoseOfTheFiles) {
  const TemporaryFolder folder;
  Image levels(16, 16, 1);  // every value of 8 bits
  for (int i = 0; i < 256; ++i) levels.pixels[i] = static_cast<float>(i) / 255;
  const Image fine = testing::NoiseImage(20, 10, 1), clear = testing::NoiseImage(9, 7, 2, 4);
  WriteText(folder / "levels.png", EncodePng8(levels));
  WriteText(folder / "fine.png", EncodePng16(fine));
  WriteText(folder / "clear.png", EncodePng8(clear));
  const KeptPictures kept(KeptPictures::Origin::kGiven);
  for (const char* name : {"levels.png", "fine.png", "clear.png"}) {
    const Image expected = ReadImage(folder / name);
    for (int time = 0; time < 2; ++time) {
      const Image picture = kept.Read(folder / name);
      EXPECT_TRUE(picture.SameSize(expected)) << name;
      EXPECT_EQ(picture.channels, expected.channels) << name;
      EXPECT_TRUE(picture.pixels == expected.pixels) << name << time;
    }
  }
  // Copies share what is kept: no file is read again.
  const KeptPictures copy = kept;
  std::filesystem::remove(folder / "fine.png");
  EXPECT_TRUE(copy.Read(folder / "fine.png").pixels == kept.Read(folder / "fine.png").pixels);
}

TEST(KeptPictures, AreReadAhead) {
  const TemporaryFolder folder;
  std::vector<std::string> paths;
  std::vector<Image> pictures;
  for (uint32_t i = 0; i < 5; ++i) {
    paths.push_back(folder / (std::to_string(i) + ".png"));
    WritePng8(paths.back(), testing::NoiseImage(20, 10, i));
    pictures.push_back(ReadImage(paths.back()));
  }
  std::filesystem::remove(paths[0]);
  const KeptPictures kept(KeptPictures::Origin::kOurs);
  kept.ReadAhead(paths);
  EXPECT_THROW(kept.Read(paths[0]), Error);
  for (size_t i = 1; i < paths.size(); ++i) {
    std::filesystem::remove(paths[i]);
    EXPECT_EQ(kept.Read(paths[i]).pixels, pictures[i].pixels);
  }
}

TEST(KeptPictures, BeyondTheLimitFilesAreReadAgain) {
  const TemporaryFolder folder;
  WriteText(folder / "a.png", EncodePng8(testing::NoiseImage(20, 10, 1)));
  WriteText(folder / "b.png", EncodePng8(testing::NoiseImage(20, 10, 2)));
  const KeptPictures kept(KeptPictures::Origin::kOurs, 20 * 10 * 3 + 100);  // one of them
  const Image a = kept.Read(folder / "a.png"), b = kept.Read(folder / "b.png");
  std::filesystem::remove(folder / "a.png");
  std::filesystem::remove(folder / "b.png");
  EXPECT_TRUE(kept.Read(folder / "a.png").pixels == a.pixels);
  EXPECT_ANY_THROW(kept.Read(folder / "b.png"));
}

}  // namespace
}  // namespace regrade
