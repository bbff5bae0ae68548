// One retouched photo: what is found in the edit, what is left out, and what is refused.
#include "pipeline/stages/photo_edit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/image/resize.h"
#include "kernels/synthetic/ray_trace.h"
#include "kernels/synthetic/synthetic_scene.h"
#include "pipeline/capture/synth_grade.h"
#include "tests/support/expect_error.h"
#include "tests/support/pictures.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

struct Pair {
  SyntheticScene scene;
  Camera camera;
  SyntheticView view;
};

const Pair& TableScene() {
  static const Pair pair = [] {
    Pair p;
    p.scene = MakeSyntheticScene("table", 0);
    p.camera = SyntheticCameras(p.scene, 5, 320, 240)[2];
    p.view = RenderSyntheticView(p.scene, p.camera);
    return p;
  }();
  return pair;
}

Image Graded(SynthGrade grade) {
  Image color = TableScene().view.color;
  ApplyGrade(grade, TableScene().scene, TableScene().camera, TableScene().view.depth, 1,
             &color);
  return color;
}

std::string Said(const PhotoEdit& edit) {
  std::string all;
  for (const std::string& notice : EditNotices(edit)) all += notice + "\n";
  return all;
}

TEST(PhotoEdit, AGlobalGradeIsOneMapOfColours) {
  const Image& photo = TableScene().view.color;
  const PhotoEdit edit = AnalyseEdit(photo, Graded(SynthGrade::kGlobal));
  EXPECT_FALSE(edit.IsLocal()) << edit.local;
  EXPECT_EQ(edit.vignette(1), 1);
  EXPECT_LT(edit.sharpening, 0.1);
  EXPECT_NE(Said(edit).find("one map of colours"), std::string::npos) << Said(edit);
  // The table is the grade on the photo's own colours: cells of 1/32 leave less than a step.
  double sum = 0;
  for (int64_t i = 0; i < photo.num_pixels(); ++i) {
    const float* p = &photo.pixels[3 * i];
    sum += Norm(edit.table({p[0], p[1], p[2]}) - GradeColor({p[0], p[1], p[2]}));
  }
  const double mean = sum / static_cast<double>(photo.num_pixels());
  EXPECT_LE(mean, testing::RecordBound("mean error of the lifted grade on its own photo",
                                       testing::Computed::kFloat, mean, 1.0 / 255));
}

TEST(PhotoEdit, ALocalGradeIsKeptInThePicture) {
  const Image edited = Graded(SynthGrade::kLocal);
  const PhotoEdit edit = AnalyseEdit(TableScene().view.color, edited);
  EXPECT_TRUE(edit.IsLocal()) << edit.local;
  EXPECT_EQ(edit.vignette(1), 1);
  EXPECT_NE(Said(edit).find("depends on the place"), std::string::npos);
  // What is above the low-pass frequency is lost beside edges.
  EXPECT_LE(testing::MeanDifference(edit.picture, edited), 0.02);
}

TEST(PhotoEdit, H186_AVignetteIsLeftOutAndSaid) {
  const PhotoEdit edit = AnalyseEdit(TableScene().view.color, Graded(SynthGrade::kVignette));
  EXPECT_NEAR(edit.vignette(1), VignetteFactor(1), 0.03);
  EXPECT_NE(Said(edit).find("a vignette (-3"), std::string::npos) << Said(edit);
  EXPECT_FALSE(edit.IsLocal()) << edit.local;
  const double moved = testing::MeanDifference(edit.picture, Graded(SynthGrade::kGlobal));
  EXPECT_LE(moved, testing::RecordBound("mean change of colours by a vignette",
                                        testing::Computed::kFloat, moved, 1.0 / 255));
}

TEST(PhotoEdit, H186_ADodgedCentreIsNoVignette) {
  Image edited = TableScene().view.color;
  for (int y = 0; y < edited.height; ++y)
    for (int x = 0; x < edited.width; ++x) {
      const double r = std::hypot(x - 160.0, y - 120.0) / 60;
      for (int c = 0; c < 3; ++c)
        edited.at(x, y)[c] =
            std::min(1.0f, edited.at(x, y)[c] * static_cast<float>(1 + 0.3 * std::exp(-r * r)));
    }
  const PhotoEdit edit = AnalyseEdit(TableScene().view.color, edited);
  EXPECT_EQ(edit.vignette(1), 1) << Said(edit);
  EXPECT_TRUE(edit.IsLocal()) << edit.local;
}

TEST(PhotoEdit, H187_SharpeningAndGrainAreLeftOutAndSaid) {
  const Image& photo = TableScene().view.color;
  const Image soft = Resize(Resize(photo, 160, 120), 320, 240);
  Image sharp = photo, grainy = photo;
  for (size_t i = 0; i < sharp.pixels.size(); ++i) {
    sharp.pixels[i] = std::clamp(2 * photo.pixels[i] - soft.pixels[i], 0.0f, 1.0f);
    grainy.pixels[i] = std::clamp(
        photo.pixels[i] + static_cast<float>((RandomDouble(1, 0, i) - 0.5) * 0.1), 0.0f, 1.0f);
  }
  const PhotoEdit sharpened = AnalyseEdit(photo, sharp), grained = AnalyseEdit(photo, grainy);
  EXPECT_NE(Said(sharpened).find("sharpening"), std::string::npos) << Said(sharpened);
  EXPECT_NE(Said(grained).find("grain"), std::string::npos) << Said(grained);
  EXPECT_EQ(Said(grained).find("sharpening"), std::string::npos) << Said(grained);
  // Where few pixels share a colour the map keeps some of a grain of 7 of 255.
  for (const PhotoEdit* edit : {&sharpened, &grained}) {
    EXPECT_FALSE(edit->IsLocal()) << edit->local;
    EXPECT_LE(testing::MeanDifference(edit->picture, photo), 3.0 / 255);
  }
}

TEST(PhotoEdit, H188_OtherSizesAreScaledAndOtherFramesRefused) {
  const Image& photo = TableScene().view.color;
  const Image graded = Graded(SynthGrade::kGlobal);
  EXPECT_TRUE(EditAtPhotoSize(Resize(graded, 480, 360), photo, "e").SameSize(photo));
  EXPECT_TRUE(EditAtPhotoSize(Resize(graded, 200, 150), photo, "e").SameSize(photo));
  EXPECT_REGRADE_ERROR(EditAtPhotoSize(Resize(graded, 240, 240), photo, "e"), ExitCode::kInput,
                       "another shape");
  // A crop of 5 %, scaled back.
  Image crop(304, 228);
  for (int y = 0; y < 228; ++y)
    for (int x = 0; x < 304; ++x) std::copy_n(graded.at(x + 10, y + 4), 3, crop.at(x, y));
  EXPECT_REGRADE_ERROR(EditAtPhotoSize(crop, photo, "e"), ExitCode::kInput,
                       "pixels from the photo's");
  // A turn of one degree: 2.8 pixels at the corners.
  Image turned(320, 240);
  for (int y = 0; y < 240; ++y)
    for (int x = 0; x < 320; ++x) {
      const double a = 0.02, dx = x - 160, dy = y - 120;
      const int u = std::clamp(static_cast<int>(std::lround(160 + dx - a * dy)), 0, 319);
      const int v = std::clamp(static_cast<int>(std::lround(120 + dy + a * dx)), 0, 239);
      std::copy_n(graded.at(u, v), 3, turned.at(x, y));
    }
  EXPECT_REGRADE_ERROR(EditAtPhotoSize(turned, photo, "e"), ExitCode::kInput,
                       "undo crop, turn");
  const Image other =
      RenderSyntheticView(MakeSyntheticScene("room", 0),
                          SyntheticCameras(MakeSyntheticScene("room", 0), 5, 320, 240)[1])
          .color;
  EXPECT_REGRADE_ERROR(EditAtPhotoSize(other, photo, "e"), ExitCode::kInput, "");
}

}  // namespace
}  // namespace regrade
