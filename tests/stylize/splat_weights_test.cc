// What rays see of splats, against the plain picture's weights and the renderer's colours.
#include "kernels/field/sample_basis.h"
#include "kernels/render/ray_weigher.h"
#include "kernels/splats/render_picture.h"
#include "tests/support/record_error.h"
#include "tests/support/splat_ball.h"

namespace regrade {
namespace {

using namespace testing;  // NOLINT: a test

std::vector<Camera> SomeCameras() {
  std::vector<Camera> cameras = Ring(3, 50);  // no multiple of a tile
  cameras[1].width = 37;
  return cameras;
}

TEST(SplatWeights, AreThoseOfThePlainPicture) {
  const RadianceField field = SplatBall(700);
  const ViewRays rays = PixelsOf(SomeCameras());
  const RayWeights weights =
      MakeRayWeigher(*field.geometry, field.near_clip, MarchOptions{})->Weigh(rays);
  ASSERT_EQ(weights.num_rays(), rays.size());
  ASSERT_EQ(weights.directions.size(), weights.samples.size());
  int64_t r = 0, most = 0;
  double largest = 0;
  for (const Camera& camera : rays.cameras) {
    const auto seen = SeeSplats(SplatsOf(field), camera, SplatOptionsOf(field));
    for (int y = 0; y < camera.height; ++y)
      for (int x = 0; x < camera.width; ++x, ++r) {
        const auto plain = WeightsOfPixel(seen, x, y);
        const int64_t first = weights.first[static_cast<size_t>(r)];
        ASSERT_EQ(weights.first[static_cast<size_t>(r) + 1] - first, std::ssize(plain));
        double sum = double{weights.transmittance[static_cast<size_t>(r)]};
        for (size_t i = 0; i < plain.size(); ++i) {
          const size_t s = static_cast<size_t>(first) + i;
          EXPECT_EQ(weights.samples[s].vertex, plain[i].index);
          EXPECT_EQ(weights.samples[s].weight, plain[i].weight);
          sum += double{plain[i].weight};
        }
        largest = std::max(largest, std::abs(sum - 1));
        most = std::max(most, std::ssize(plain));
      }
  }
  EXPECT_GT(most, 8);
  EXPECT_LE(largest,
            RecordDigits("sum of weights and transmittance", Computed::kFloat, largest, 1e-5));
}

TEST(SplatWeights, ColorsAreTheRenderers) {
  const RadianceField field = SplatBall(700);
  const ViewRays rays = PixelsOf(SomeCameras());
  const RayWeights weights =
      MakeRayWeigher(*field.geometry, field.near_clip, MarchOptions{})->Weigh(rays);
  const FieldRenderer renderer(field, Backend::kCpu);
  size_t r = 0;
  double largest = 0;
  for (const Camera& camera : rays.cameras) {
    const Image picture = renderer.Render(camera).color;
    for (int64_t i = 0; i < picture.num_pixels(); ++i, ++r) {
      Vec3f color = field.background * weights.transmittance[r];
      SampleBasis<float> basis(9, rays.rays[r].direction, weights);
      for (int64_t s = weights.first[r]; s < weights.first[r + 1]; ++s) {
        const WeightedSample& sample = weights.samples[static_cast<size_t>(s)];
        const float* const gamma = basis.Of(s);
        for (int c = 0; c < 3; ++c) {
          float value = 0.5f;
          for (int k = 0; k < 9; ++k)
            value += field.appearance.sh[27 * int64_t{sample.vertex} + 9 * c + k] * gamma[k];
          color[c] += sample.weight * std::max(value, 0.0f);
        }
      }
      for (int c = 0; c < 3; ++c)
        largest =
            std::max(largest, std::abs(double{std::clamp(color[c], 0.0f, 1.0f)} -
                                       double{picture.pixels[static_cast<size_t>(3 * i + c)]}));
    }
  }
  EXPECT_LE(largest, RecordDigits("colours from weights", Computed::kFloat, largest, 2e-5));
}

TEST(SplatWeights, SmallOnesAreDroppedAndOthersStay) {
  const RadianceField field = SplatBall(700);
  const ViewRays rays = PixelsOf({Ring(3, 40)[1]});
  const auto weights_above = [&](float least) {
    return MakeRayWeigher(*field.geometry, field.near_clip, MarchOptions{}, least)->Weigh(rays);
  };
  const RayWeights all = weights_above(0), some = weights_above(0.02f);
  EXPECT_EQ(all.transmittance, some.transmittance);
  size_t next = 0;
  for (const WeightedSample& sample : all.samples) {
    if (!(sample.weight > 0.02f)) continue;
    ASSERT_LT(next, some.samples.size());
    EXPECT_EQ(some.samples[next].vertex, sample.vertex);
    EXPECT_EQ(some.samples[next++].weight, sample.weight);
  }
  EXPECT_EQ(next, some.samples.size());
  EXPECT_LT(next, all.samples.size());
}

// Any order of rays, cameras whose lists were kept or not, any number of threads.
TEST(SplatWeights, DoNotDependOnOrderOrMemory) {
  const RadianceField field = SplatBall(500);
  const std::vector<Camera> cameras = Ring(4, 40);
  const ViewRays rays = PixelsOf(cameras);
  const Threads one(1);
  const RayWeights plain =
      MakeRayWeigher(*field.geometry, field.near_clip, MarchOptions{})->Weigh(rays);
  const Threads many(5);
  for (const int64_t kept : {int64_t{0}, int64_t{6000}, int64_t{1} << 30}) {
    const auto weigher =
        MakeRayWeigher(*field.geometry, field.near_clip, MarchOptions{}, 0, kept);
    ViewRays mixed{.cameras = cameras};
    std::vector<size_t> from;
    for (size_t i = 0; i < 4000; ++i) {
      from.push_back(i * 7919 % rays.rays.size());
      const ViewPlace& place = rays.places[from.back()];
      mixed.Add(place.camera, place.u, place.v);
    }
    for (const int64_t begin : {0, 1000, 2000, 3000}) {
      const RayWeights part = weigher->Weigh(mixed, begin, begin + 1000);
      for (size_t r = 0; r < 1000; ++r) {
        const size_t to = from[static_cast<size_t>(begin) + r];
        ASSERT_EQ(part.transmittance[r], plain.transmittance[to]);
        ASSERT_EQ(part.first[r + 1] - part.first[r], plain.first[to + 1] - plain.first[to]);
        for (int64_t i = 0; i < part.first[r + 1] - part.first[r]; ++i) {
          const auto& a = part.samples[static_cast<size_t>(part.first[r] + i)];
          const auto& b = plain.samples[static_cast<size_t>(plain.first[to] + i)];
          ASSERT_EQ(a.vertex, b.vertex);
          ASSERT_EQ(a.weight, b.weight);
        }
      }
    }
  }
}

TEST(SplatWeights, DepthsAreThePictures) {
  const RadianceField field = SplatBall(900);
  const Camera camera = Ring(5, 40)[2];
  const auto weigher = MakeRayWeigher(*field.geometry, field.near_clip, MarchOptions{});
  const std::vector<double> depths = RayDepths(field, PixelsOf({camera}), weigher.get());
  const Image picture = FieldRenderer(field, Backend::kCpu).Render(camera).depth;
  // Where a splat leaves half of the light to a rounding, the next one may be taken.
  int seen = 0, others = 0;
  for (size_t i = 0; i < depths.size(); ++i) {
    others += !(std::abs(depths[i] - picture.pixels[i]) < 1e-4);
    seen += depths[i] > 0;
  }
  EXPECT_LE(others, std::ssize(depths) / 1000);  // as FastSplats.RendersAsThePlainPicture
  EXPECT_GT(seen, 400);
  EXPECT_LT(seen, 1600);
}

// EQ(color-bound), of pictures whose colours are not clamped and of others.
class ColorBound : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Degrees, ColorBound, ::testing::Values(2, 3));

TEST_P(ColorBound, PicturesDifferByAtMostTheCoefficients) {
  const int basis = BasisOfDegree(GetParam()), terms = 3 * basis;
  for (const float contrast : {0.3f, 2.0f}) {
    RadianceField one = SplatBall(700, contrast, basis), other = one;
    double most = 0;
    for (int64_t i = 0; i < one.geometry->num_voxels(); ++i) {
      double sum = 0;
      for (int k = 0; k < terms; ++k) {
        const double change = 0.1 * Random(81, static_cast<uint64_t>(terms * i + k));
        other.appearance.sh[terms * i + k] += static_cast<float>(change);
        sum += change * change;
      }
      most = std::max(most, std::sqrt(sum));
    }
    const double gamma = (GetParam() + 1) / (2 * std::sqrt(M_PI));  // 0.846, 1.128
    double largest = 0;
    for (const Camera& camera : Ring(4, 40)) {
      const auto a = RenderSplatsPlain(SplatsOf(one), camera, SplatOptionsOf(one));
      const auto b = RenderSplatsPlain(SplatsOf(other), camera, SplatOptionsOf(other));
      for (size_t i = 0; i < a.transmittance.size(); ++i) {
        Vec3d d;
        for (size_t c = 0; c < 3; ++c)
          d[static_cast<int>(c)] = double{a.color[3 * i + c]} - double{b.color[3 * i + c]};
        const double opacity = 1 - double{a.transmittance[i]};
        EXPECT_LE(Norm(d), opacity * gamma * most + 1e-5);
        largest = std::max(largest, Norm(d) / (gamma * most));
      }
    }
    EXPECT_GT(largest, 0.05);
  }
}

}  // namespace
}  // namespace regrade
