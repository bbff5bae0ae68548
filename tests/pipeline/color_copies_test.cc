// Copies of one capture with other colour profiles and bits, from the files to the field and to
// pictures that are rendered of it.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "kernels/field/cpu/render_view.h"
#include "pipeline/capture/transforms_json.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "tests/pipeline/color_files.h"
#include "tests/pipeline/picture_corpus.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::LargestDifference;
using testing::MeanDifference;
using testing::Primaries;

constexpr char kFirstPhoto[] = "/images/00000.png";

// A capture with given poses whose photos are replaced.
class ColorCopies : public testing::PictureTest {
 protected:
  void SetUp() override { testing::WriteCapture(scratch_ / "srgb", 16, "128x96"); }
  // Photos as 16-bit TIFF files, or 8-bit PNG files, of other primaries.
  void Copy(const std::string& name, const Primaries& primaries, double gamma,
            const std::string& icc, bool tiff) {
    fs::copy(scratch_ / "srgb", scratch_ / name, fs::copy_options::recursive);
    for (const auto& entry : fs::directory_iterator(scratch_ / name + "/images")) {
      const Image photo = ReadImage(entry.path());
      const std::string file = scratch_ / (tiff ? "photo.tif" : "photo.png");
      testing::WriteWithProfile(file, testing::EncodedIn(primaries, gamma, photo), icc,
                                tiff ? OIIO::TypeDesc::UINT16 : OIIO::TypeDesc::UINT8);
      fs::rename(file, entry.path());  // the content decides
    }
  }
  // A photo as it was staged, and the renders at all photos' places, one below the other.
  struct Seen {
    Image staged, render;
  };
  Seen Reconstruct(const std::string& name, const std::string& seed = "0") {
    const std::string out = scratch_ / name + "_out" + seed;
    testing::Said(testing::Joined(
        {"reconstruct", scratch_ / name + "/truth", "--out", out, "--seed", seed},
        testing::Words("--photo-size 96 --field voxels --config "
                       R"({"fit-resolutions":[32],"fit-steps":[300]} )"
                       "--threads 2 --tracks given --holdout 0 --reproducible --effects "
                       "exposure=off,view-dependence=off")));
    const StoredField stored = ReadFieldFile(out + "/field.npz");
    const WorkingViews views = ReadWorkingViews(out + "/poses", 96, 0).InField(stored);
    Image renders(96, 0, 3);
    for (const Camera& camera : views.Cameras()) {
      const Image render = RenderView(stored.field, camera, stored.field.march).color;
      renders.height += render.height;
      renders.pixels.insert(renders.pixels.end(), render.pixels.begin(), render.pixels.end());
    }
    return {ReadImage(out + "/poses/photos/00000.png"), std::move(renders)};
  }
};

// The largest difference of the mean colours, over the channels.
double ColorShift(const Image& a, const Image& b) {
  double sum[3] = {0, 0, 0};
  for (size_t i = 0; i < a.pixels.size(); ++i) sum[i % 3] += a.pixels[i] - b.pixels[i];
  const double largest = std::max({std::abs(sum[0]), std::abs(sum[1]), std::abs(sum[2])});
  return largest / static_cast<double>(a.num_pixels());
}

TEST_F(ColorCopies, H145_TheFieldHasTheColoursOfTheSrgbCapture) {
  const Seen srgb = Reconstruct("srgb");
  // A fit is chaotic: with other random numbers, and as much with photos that differ in the
  // fifth digit, single pixels of its renders differ by tenths. A change of colours is a shift
  // of them all: without the profile, of several steps.
  const double noise = MeanDifference(Reconstruct("srgb", "1").render, srgb.render);
  struct Case {
    const char* name;
    Primaries primaries;
    double gamma;
    bool tiff;
    double photos;  // largest difference
  };
  // What the file's bits can say, as in color_profile_test.cc.
  const Case cases[] = {{"adobe", testing::kAdobePrimaries, 563 / 256.0, true, 1e-3},
                        {"p3_eight", testing::kP3Primaries, 0, false, 6.0 / 255}};
  for (const Case& copy : cases) {
    Copy(copy.name, copy.primaries, copy.gamma,
         testing::IccProfile(copy.primaries, copy.gamma, copy.name), copy.tiff);
    const Seen seen = Reconstruct(copy.name);
    const double photos = LargestDifference(seen.staged, srgb.staged);
    EXPECT_LT(photos, testing::RecordBound(std::string("photos, ") + copy.name,
                                           testing::Computed::kFloat, photos, copy.photos));
    const double shift = ColorShift(seen.render, srgb.render);
    EXPECT_LT(shift, testing::RecordBound(std::string("field, ") + copy.name,
                                          testing::Computed::kFloat, shift, 1.0 / 255));
    EXPECT_LT(MeanDifference(seen.render, srgb.render), 2 * noise) << copy.name;
    if (copy.primaries == testing::kP3Primaries) {
      EXPECT_GT(ColorShift(testing::EncodedIn(copy.primaries, 0, srgb.staged), srgb.staged),
                2.0 / 255);
    }
  }
}

// A photo of 16 bits goes through the field and comes back as a picture of 16 bits.
TEST_F(ColorCopies, H142_SixteenBitsGoToTheFieldAndBack) {
  const Image photo = ReadImage(scratch_ / "srgb" + kFirstPhoto);
  Copy("p3", testing::kP3Primaries, 0, testing::IccProfile(testing::kP3Primaries, 0, "P3"),
       true);
  const Seen seen = Reconstruct("p3");
  EXPECT_EQ(DecodePhoto(scratch_ / "p3_out0/poses/photos/00000.png").bits, 16);
  EXPECT_LT(LargestDifference(seen.staged, photo), 1.0 / 255);
  WritePng16(scratch_ / "still.png", seen.render);
  const DecodedPhoto still = DecodePhoto(scratch_ / "still.png");
  EXPECT_EQ(still.bits, 16);
  EXPECT_LT(LargestDifference(still.image, seen.render), 0.51 / 65535);
}

}  // namespace
}  // namespace regrade
