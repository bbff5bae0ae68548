// What the controls of a table show: each row is better in one metric, for a reason that
// another metric sees.
#include "pipeline/stages/control_sequences.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "evaluate/fidelity.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/image/color_statistics.h"
#include "pipeline/stages/control_field.h"
#include "pipeline/stages/frame_gains.h"
#include "pipeline/stages/linear_map_baseline.h"
#include "tests/evaluate/synthetic_frames.h"
#include "tests/support/small_field.h"

namespace regrade {
namespace {

using testing::Frames;
using testing::NoiseImage;
using testing::WaveImage;

constexpr int kFrames = 5;

Image Styled(const Image& source) {
  Image styled = source;
  for (int64_t p = 0; p < styled.num_pixels(); ++p) {
    float* c = &styled.pixels[3 * p];
    const float red = c[0], green = c[1], blue = c[2];
    c[0] = 0.7f * red + 0.3f * green;
    c[1] = 0.2f + 0.5f * blue;
    c[2] = 0.6f * green * green;  // no linear map
  }
  return styled;
}

Image WithNoise(Image image, uint64_t seed) {
  const Image noise = NoiseImage(image.width, image.height, seed);
  for (size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] += 0.06f * (noise.pixels[i] - 0.5f);
  return image;
}

struct Row {
  double consistency_db = 0;
  FidelityRow fidelity;
};

// A texture that moves by a pixel a frame. The style adds stripes of two pixels that move
// along, and its frames flicker.
std::map<std::string, Row> Table() {
  std::vector<Image> source, views_2d, styled;
  for (int i = 0; i < kFrames; ++i) {
    source.push_back(WaveImage(240, 90, i, 0));
    Image frame = Styled(source.back());
    for (int y = 0; y < frame.height; ++y)
      for (int x = 0; x < frame.width; ++x)
        if (((x - i + 40) / 2) % 2)
          for (int c = 0; c < 3; ++c) frame.at(x, y)[c] += 0.2f;
    styled.push_back(WithNoise(frame, 10 + i));
    views_2d.push_back(std::move(frame));
  }
  const FrameSource unstyled = Frames(source);
  FidelityTargets targets;
  targets.views_2d = Frames(views_2d);
  targets.unstyled = unstyled;
  std::vector<NamedFrameSource> sequences{{"styled", Frames(styled)}};
  for (auto& control : ControlSequences({unstyled, Frames(styled), targets.views_2d}))
    sequences.push_back(control);
  ConsistencyOptions options;
  options.gaps = {1};
  std::map<std::string, Row> rows;
  for (const ConsistencyRow& row : EvaluateConsistency(unstyled, sequences, options).rows)
    rows[row.sequence].consistency_db = *row.tc_psnr_mean_db;
  for (const NamedFrameSource& sequence : sequences)
    rows[sequence.name].fidelity = MeasureFidelity(sequence, targets);
  return rows;
}

// Blurred frames have less noise and no stripes, grey ones less noise and no colour, mapped
// ones neither noise nor stripes.
TEST(ControlSequences, EachIsMoreConsistentAndLessFaithful) {
  auto rows = Table();
  ASSERT_EQ(rows.size(), 4u);
  const Row& styled = rows["styled"];
  for (const char* name : {kBlurredControl, kGreyControl, kLinearMapControl}) {
    EXPECT_GT(rows[name].consistency_db, styled.consistency_db + 1) << name;
    EXPECT_LT(*rows[name].fidelity.psnr_to_2d_db, *styled.fidelity.psnr_to_2d_db - 3) << name;
  }
  EXPECT_LT(*rows[kGreyControl].fidelity.chroma, 0.01);
  EXPECT_GT(*styled.fidelity.chroma, 5);
}

// Without the 2D method's frames the map goes to the style picture's colours; without that, and
// where only an object is styled, there is none.
TEST(ControlSequences, TheMapNeedsATarget) {
  const FrameSource frames = Frames({WaveImage(40, 30, 0, 0), WaveImage(40, 30, 1, 0)});
  EXPECT_EQ(ControlSequences({frames, frames}).size(), 2u);
  const Image style = Styled(NoiseImage(32, 32, 1));
  const auto with_style = ControlSequences({frames, frames, {}, &style}, "path_");
  ASSERT_EQ(with_style.size(), 3u);
  EXPECT_EQ(with_style[0].name, std::string("path_") + kLinearMapControl);
  const Image mapped = with_style[0].frames.frame(1);
  const Vec3d want = MeasureColor(style).mean, have = MeasureColor(mapped).mean;
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(have[c], want[c], 0.03);  // colours are clipped
  EXPECT_EQ(ControlSequences({frames, frames, {}, &style, false}).size(), 2u);
}

// --- frames with the exposures of their photos

// Two views of a field whose style is a linear map: nothing is clipped.
struct ExposedViews {
  StoredField stored{testing::RandomField({8, 8, 8}, 1, 1.0, 3), {}, {}};
  std::vector<Camera> cameras = std::vector<Camera>(2);
  PhotoGains gains{{{{0.5, 0.5, 0.6}}, {{1.4, 1.3, 1.2}}}};
  FrameSource source, views_2d;
  Vec3f background_2d;

  ExposedViews() {
    RadianceField& field = stored.field;
    for (int64_t i = 0; i < field.appearance.sh.size(); ++i) field.appearance.sh[i] *= 0.4f;
    for (size_t i = 0; i < cameras.size(); ++i) {
      Camera& camera = cameras[i];
      camera.width = 40, camera.height = 30;
      camera.fx = camera.fy = 40, camera.cx = 20, camera.cy = 15;
      camera.camera_from_world.translation = {0.3 * static_cast<double>(i), 0, 4};
    }
    ColorMap map;
    map.matrix.row[0] = {0.7, 0.2, 0};
    map.offset = {0, 0.1, -0.05};
    RadianceField styled = field;
    styled.appearance = ApplyColorMap(field.appearance, map);
    styled.background = background_2d = MapBackground(map, field.background);
    source = PutGains(Rendered(field), gains);
    views_2d = PutGains(Rendered(styled), gains);
  }

  FrameSource Rendered(const RadianceField& field) const {
    return {static_cast<int>(cameras.size()), [this, field](int i) {
              return RenderView(field, cameras[static_cast<size_t>(i)], field.march).color;
            }};
  }
};

TEST(FrameGains, TheLinearMapsFieldIsComparedInTheFramesExposures) {
  const ExposedViews v;
  const auto psnr = [&v](const PhotoGains& gains) {
    return *LinearMapPsnr(v.stored.field, v.cameras, v.source, v.views_2d, {}, gains,
                          Backend::kCpu, {});
  };
  EXPECT_GT(psnr(v.gains), 50);
  EXPECT_LT(psnr({}), 25);
}

TEST(FrameGains, TheCeilingIsFittedAndComparedInTheFramesExposures) {
  ExposedViews v;
  v.stored.field.background = v.background_2d;  // which is not fitted
  const auto psnr = [&v](const PhotoGains& gains) {
    const StoredField ceiling =
        CeilingField(v.stored, v.cameras, UndoGains(v.views_2d, gains), 1, {});
    return *MeasureFidelity(ControlFieldFrames(ceiling, v.cameras, gains, kCeilingControl),
                            {v.views_2d, {}, nullptr, {}, {}, /*only_psnr=*/true})
                .psnr_to_2d_db;
  };
  EXPECT_GT(psnr(v.gains), 35);
  EXPECT_LT(psnr({}), 30);
}

TEST(FrameGains, AreThoseOfThePhotosWithKeepExposureOnly) {
  Capture capture;
  capture.views.resize(3);
  const std::vector<PhotoGain> of_view{{{0.5, 1, 1}}, kAsTaken, {{1, 1, 2}, 0.25}};
  const WorkingViews views = WorkingViews(capture, 100, 0).WithGains({of_view});
  RenderOptions options;
  EXPECT_TRUE(FrameGains(views, options, {0, 2}).of_view.empty());
  options.keep_exposure = true;
  EXPECT_EQ(FrameGains(views, options, {2, 0}).of_view,
            (std::vector<PhotoGain>{of_view[2], of_view[0]}));
}

}  // namespace
}  // namespace regrade
