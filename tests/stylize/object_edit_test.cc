// A style for one object: masks that disagree vote, and what is not of the object keeps its
// bits.
#include <algorithm>
#include <cstring>

#include "kernels/field/cpu/render_view.h"
#include "stylize/field/blend_fields.h"
#include "stylize/field/object_weights.h"
#include "stylize/image/masked_stylizer.h"
#include "tests/support/styled_ball.h"

namespace regrade {
namespace {

using namespace testing;  // NOLINT: a test

// The object is the ball's upper half; each voxel's truth is the sign of its height.
struct MaskedBall {
  RadianceField field = Ball(20);
  std::vector<Camera> cameras = Ring(6, 48);
  std::vector<Image> masks;

  MaskedBall() {
    std::vector<float> upper(static_cast<size_t>(field.geometry->num_voxels()));
    for (size_t v = 0; v < upper.size(); ++v) upper[v] = Height(static_cast<int64_t>(v)) > 0;
    const RadianceField truth = WeightField(field, upper);
    for (const Camera& camera : cameras) {
      const Image color = RenderView(truth, camera, MarchOptions{}).color;
      Image mask(camera.width, camera.height, 1);
      for (int64_t i = 0; i < mask.num_pixels(); ++i)
        mask.pixels[static_cast<size_t>(i)] =
            color.pixels[static_cast<size_t>(3 * i)] > 0.5f ? 1.0f : 0.0f;
      masks.push_back(mask);
    }
  }
  float Height(int64_t voxel) const {
    static const std::vector<int32_t> vertex = VertexOfVoxel(*field.geometry);
    const int z = vertex[static_cast<size_t>(voxel)] % field.geometry->frame.resolution.z;
    return field.geometry->frame.WorldOf({0, 0, static_cast<float>(z)}).z;
  }
  std::vector<float> Vote(const std::vector<Image>& given) const {
    MaskVote vote(*field.geometry, 0, MarchOptions{});
    for (size_t i = 0; i < cameras.size(); ++i) vote.Add(cameras[i], given[i]);
    return vote.Weights(0.5, 0.25);
  }
  RadianceField Edited(const std::vector<float>& weights) const {
    RadianceField styled = field;
    styled.appearance = ApplyColorMap(field.appearance, SomeMap());
    styled.background = {1, 0, 0};  // must not show
    return MixFields(field, {&styled}, {1}, &weights);
  }
};

int Differing(const Image& a, const Image& b) {
  int count = 0;
  for (int64_t i = 0; i < a.num_pixels(); ++i)
    count += std::memcmp(&a.pixels[static_cast<size_t>(3 * i)],
                         &b.pixels[static_cast<size_t>(3 * i)], 3 * sizeof(float)) != 0;
  return count;
}

TEST(ObjectEdit, H50_OutsideTheObjectEveryPixelIsTheSources) {
  const MaskedBall ball;
  const std::vector<float> object_weights = ball.Vote(ball.masks);
  const RadianceField edited = ball.Edited(object_weights);
  int inside = 0, outside = 0;
  for (const Camera& camera : ball.cameras) {
    const Image before = RenderView(ball.field, camera, MarchOptions{}).color,
                after = RenderView(edited, camera, MarchOptions{}).color;
    // Where no sample has a weight: the same rays, without any voxel of the object in reach.
    for (int y = 0; y < camera.height; ++y)
      for (int x = 0; x < camera.width; ++x) {
        const Ray ray = camera.PixelRay(x, y);
        const RayWeights weights =
            ComputeRayWeights(*ball.field.geometry, {&ray, 1}, MarchOptions{}, 0);
        bool touches = false;
        for (const WeightedSample& sample : weights.samples) {
          for (int corner = 0; corner < 8; ++corner) {
            const int32_t voxel =
                ball.field.geometry
                    ->links[CornerVertex(ball.field.geometry->frame, sample.vertex, corner)];
            if (voxel >= 0) touches |= object_weights[static_cast<size_t>(voxel)] > 0;
          }
        }
        const bool same = std::memcmp(before.at(x, y), after.at(x, y), 3 * sizeof(float)) == 0;
        if (!touches) {
          EXPECT_TRUE(same) << x << " " << y;
          ++outside;
        } else {
          inside += !same;
        }
      }
  }
  EXPECT_GT(outside, 2000);
  EXPECT_GT(inside, 1000);
}

TEST(ObjectEdit, H50_WrongMasksAreOutvoted) {
  const MaskedBall ball;
  const std::vector<float> right = ball.Vote(ball.masks);
  std::vector<Image> given = ball.masks;
  std::fill(given[1].pixels.begin(), given[1].pixels.end(), 0.0f);  // forgotten
  for (float& m : given[4].pixels) m = 1 - m;                       // the wrong way round
  const std::vector<float> weights = ball.Vote(given);
  double wrong = 0, seen = 0;
  for (int64_t v = 0; v < ball.field.geometry->num_voxels(); ++v) {
    // Away from the seam, and where the ball's skin is: inside nobody looks.
    if (std::abs(ball.Height(v)) < 0.25f) continue;
    const float truth = ball.Height(v) > 0;
    if (right[static_cast<size_t>(v)] != truth) continue;  // unseen from all sides
    seen += 1;
    wrong += std::abs(weights[static_cast<size_t>(v)] - truth);
  }
  EXPECT_GT(seen, 500);
  EXPECT_LT(wrong / seen, 0.2);
  // Voxels that two wrong photos alone vote for stay exactly what they were.
  const RadianceField edited = ball.Edited(weights);
  int kept = 0;
  for (int64_t v = 0; v < ball.field.geometry->num_voxels(); ++v)
    if (weights[static_cast<size_t>(v)] == 0) {
      ASSERT_EQ(std::memcmp(&edited.appearance.sh[v * 27], &ball.field.appearance.sh[v * 27],
                            27 * sizeof(float)),
                0);
      ++kept;
    }
  EXPECT_GT(kept, 500);
}

TEST(ObjectEdit, H50_EmptyAndFullMasks) {
  const MaskedBall ball;
  std::vector<Image> masks = ball.masks;
  for (Image& mask : masks) std::fill(mask.pixels.begin(), mask.pixels.end(), 0.0f);
  for (const float weight : ball.Vote(masks)) ASSERT_EQ(weight, 0);
  const RadianceField none = ball.Edited(ball.Vote(masks));
  EXPECT_EQ(Differing(RenderView(none, ball.cameras[0], {}).color,
                      RenderView(ball.field, ball.cameras[0], {}).color),
            0);
  for (Image& mask : masks) std::fill(mask.pixels.begin(), mask.pixels.end(), 1.0f);
  const std::vector<float> all = ball.Vote(masks);
  int64_t seen = 0;
  for (const float weight : all) {
    ASSERT_TRUE(weight == 0 || weight == 1) << weight;  // 0: no photo shows it
    seen += weight == 1;
  }
  EXPECT_GT(seen, 1000);
}

TEST(ObjectEdit, VotesDoNotDependOnTheirOrderOrOnThreads) {
  const MaskedBall ball;
  MaskVote backwards(*ball.field.geometry, 0, MarchOptions{});
  const std::vector<float> weights = ball.Vote(ball.masks);
  const Threads single(1);
  for (size_t i = ball.cameras.size(); i-- > 0;) backwards.Add(ball.cameras[i], ball.masks[i]);
  EXPECT_EQ(backwards.Weights(0.5, 0.25), weights);
}

TEST(ObjectEdit, H50_EdgesAreSoftAndAnEdgeOfZeroIsHard) {
  const MaskedBall ball;
  MaskVote vote(*ball.field.geometry, 0, MarchOptions{});
  for (size_t i = 0; i < ball.cameras.size(); ++i) vote.Add(ball.cameras[i], ball.masks[i]);
  int between = 0;
  for (const float weight : vote.Weights(0.5, 0.25)) between += weight > 0 && weight < 1;
  EXPECT_GT(between, 20);
  for (const float weight : vote.Weights(0.5, 0)) ASSERT_TRUE(weight == 0 || weight == 1);
  // An edge wider than the threshold is cut: a vote of 0 stays 0.
  MaskVote nobody(*ball.field.geometry, 0, MarchOptions{});
  for (const Camera& camera : ball.cameras)
    nobody.Add(camera, Image(camera.width, camera.height, 1));
  for (const float weight : nobody.Weights(0.1, 0.5)) ASSERT_EQ(weight, 0);
}

// --- by region in 2D

// Adds the mean of the pixels that alpha selects to all of them.
class MeanAdder : public ViewStylizer {
 public:
  Image Stylize(const Image& view, int) const override {
    double sum = 0;
    int count = 0;
    for (int64_t i = 0; i < view.num_pixels(); ++i)
      if (view.pixels[static_cast<size_t>(4 * i + 3)] > 0.5f)
        sum += view.pixels[static_cast<size_t>(4 * i)], ++count;
    Image result = view;
    for (int64_t i = 0; i < view.num_pixels(); ++i)
      for (int c = 0; c < 3; ++c)
        result.pixels[static_cast<size_t>(4 * i + c)] += static_cast<float>(sum / count);
    return result;
  }
  std::string Name() const override { return "mean"; }
};

TEST(MaskedStylizer, H50_RegionsAreMixedAndTheRestKeepsItsBits) {
  Image view(8, 1), left(8, 1, 1), right(8, 1, 1);
  for (int x = 0; x < 8; ++x)
    for (int c = 0; c < 3; ++c) view.at(x, 0)[c] = 0.1f * static_cast<float>(x) + 0.013f;
  left.pixels = {1, 1, 0.75f, 0, 0, 0, 0, 0};
  right.pixels = {0, 0, 0.25f, 0, 0, 0, 1, 1};
  std::vector<std::unique_ptr<ViewStylizer>> regions;
  regions.push_back(std::make_unique<MeanAdder>());
  regions.push_back(std::make_unique<MeanAdder>());
  const auto stylizer = MakeMaskedStylizer(std::move(regions), true, [&](const Image&, int) {
    return std::vector<Image>{left, right};
  });
  const Image styled = stylizer->Stylize(view, 0);
  for (int x = 3; x < 6; ++x) EXPECT_EQ(*styled.at(x, 0), *view.at(x, 0));
  const float of_left = (view.pixels[0] + view.pixels[3] + view.pixels[6]) / 3,
              of_right = (view.pixels[18] + view.pixels[21]) / 2;
  EXPECT_NEAR(*styled.at(0, 0) - *view.at(0, 0), of_left, 1e-6);
  EXPECT_NEAR(*styled.at(7, 0) - *view.at(7, 0), of_right, 1e-6);
  EXPECT_NEAR(*styled.at(2, 0) - *view.at(2, 0), 0.75f * of_left + 0.25f * of_right, 1e-6);
  // A view without the second region.
  std::fill(right.pixels.begin(), right.pixels.end(), 0.0f);
  EXPECT_EQ(*stylizer->Stylize(view, 0).at(7, 0), *view.at(7, 0));
}

}  // namespace
}  // namespace regrade
