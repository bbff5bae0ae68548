// Copies of one capture with other colour profiles and bits, from the files to the field and to
// pictures that are rendered of it.
#include <gtest/gtest.h>

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
using testing::MaxDifference;
using testing::MeanDifference;
using testing::Primaries;

constexpr char kFirstPhoto[] = "/images/00000.png";

// A capture with given poses whose photos are replaced.
class ColorCopies : public testing::PictureTest {
 protected:
  void SetUp() override {
    ASSERT_EQ(Regrade({"synth", scratch_ / "srgb", "--views", "6", "--size", "128x96"}), 0);
  }
  static int Regrade(const std::vector<std::string>& arguments) {
    const testing::ProgramOutcome done = testing::RunProgram(REGRADE_PROGRAM, arguments);
    if (done.code != 0) std::printf("%s\n", done.text.c_str());
    return done.code;
  }
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
  // The photo as it was staged, and the render at its place.
  struct Seen {
    Image staged, render;
  };
  Seen Reconstruct(const std::string& name) {
    const std::string out = scratch_ / name + "_out";
    std::vector<std::string> words = {"reconstruct", scratch_ / name + "/truth", "--out", out,
                                      "--reproducible"};
    for (const std::string& flag : testing::TinyFlags()) words.push_back(flag);
    words.insert(words.end(), {"--effects", "exposure=off"});
    EXPECT_EQ(Regrade(words), 0);
    const StoredField stored = ReadFieldFile(out + "/field.npz");
    const WorkingViews views = ReadWorkingViews(out + "/poses", 96, 0)
                                   .InField(stored.field_from_world, stored.ndc);
    return {ReadImage(out + "/poses/photos/00000.png"),
            RenderView(stored.field, views.CameraOf(0), {stored.field.step}).color};
  }
};

TEST_F(ColorCopies, H145_TheFieldHasTheColoursOfTheSrgbCapture) {
  const Seen srgb = Reconstruct("srgb");
  struct Case {
    const char* name;
    Primaries primaries;
    double gamma;
    bool tiff;
    double tolerance;  // of the field's colours
  };
  const Case cases[] = {{"sixteen", testing::kSrgbPrimaries, 0, true, 1.0 / 255},
                        {"p3", testing::kP3Primaries, 0, true, 1.0 / 255},
                        {"adobe", testing::kAdobePrimaries, 563 / 256.0, true, 1.0 / 255},
                        {"p3_eight", testing::kP3Primaries, 0, false, 1.0 / 255}};
  for (const Case& copy : cases) {
    Copy(copy.name, copy.primaries, copy.gamma,
         testing::IccProfile(copy.primaries, copy.gamma, copy.name), copy.tiff);
    const Seen seen = Reconstruct(copy.name);
    const double photos = MaxDifference(seen.staged, srgb.staged);
    const double field = MaxDifference(seen.render, srgb.render);
    // What the file's bits can say (color_profile_test.cc); the fit averages it over many rays.
    if (copy.tiff) {
      EXPECT_LT(photos, testing::RecordBound(std::string("photos, ") + copy.name,
                                             testing::Computed::kFloat, photos, 1.0 / 255));
    }
    EXPECT_LT(field, testing::RecordBound(std::string("field, ") + copy.name,
                                          testing::Computed::kFloat, field, copy.tolerance));
  }
}

// A photo of 16 bits goes through the field and comes back as a picture of 16 bits.
TEST_F(ColorCopies, H142_SixteenBitsGoToTheFieldAndBack) {
  const Image photo = ReadImage(scratch_ / "srgb" + kFirstPhoto);
  Copy("p3", testing::kP3Primaries, 0, testing::IccProfile(testing::kP3Primaries, 0, "P3"), true);
  const Seen seen = Reconstruct("p3");
  EXPECT_EQ(DecodePhoto(scratch_ / "p3_out/poses/photos/00000.png").bits, 16);
  EXPECT_LT(MaxDifference(seen.staged, photo), 1.0 / 255);
  WritePng16(scratch_ / "still.png", seen.render);
  const DecodedPhoto still = DecodePhoto(scratch_ / "still.png");
  EXPECT_EQ(still.bits, 16);
  EXPECT_LT(MaxDifference(still.image, seen.render), 0.51 / 65535);
}

}  // namespace
}  // namespace regrade
