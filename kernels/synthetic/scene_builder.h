// How synthetic scenes are put together.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <string>

#include "kernels/base/random.h"
#include "kernels/synthetic/synthetic_scene.h"

namespace regrade {

// sRGB colours as 0xRRGGBB; the first is the ground.
using Palette = std::array<uint32_t, 5>;

// Places solids and gives each paint another random stream.
class SceneBuilder {
 public:
  // `detail`: of every paint.
  SceneBuilder(const std::string& name, uint64_t seed, double detail = kFinestDetail)
      : seed_(seed), detail_(detail) {
    scene_.name = name;
  }

  Paint MakePaint(Pattern pattern, double size, Palette hex) {
    Paint paint;
    paint.pattern = pattern;
    paint.size = size;
    for (int i = 0; i < 5; ++i) paint.palette[i] = LinearFromHex(hex[i]);
    paint.seed = RandomBits(seed_, 1, ++num_paints_);
    paint.detail = detail_;
    return paint;
  }

  Solid& Add(Shape shape, Vec3d center, Vec3d half, Paint paint, double yaw_degrees = 0) {
    Solid solid;
    solid.shape = shape;
    solid.center = center;
    solid.half = half;
    solid.cos_yaw = std::cos(yaw_degrees * M_PI / 180);
    solid.sin_yaw = std::sin(yaw_degrees * M_PI / 180);
    solid.paint = paint;
    scene_.solids.push_back(solid);
    return scene_.solids.back();
  }

  // A ball of glazed ceramic lying on height z.
  void AddBall(double x, double y, double z, double radius, Paint paint) {
    Add(Shape::kSphere, {x, y, z + radius}, {radius, 0, 0}, paint).gloss = 0.6;
  }
  void AddPot(double x, double y, double z, double radius, double height, Paint paint) {
    Add(Shape::kCylinder, {x, y, z + height / 2}, {radius, 0, height / 2}, paint).gloss = 0.4;
  }
  void AddBlock(double x, double y, double z, Vec3d size, double yaw_degrees, Paint paint) {
    Add(Shape::kBox, {x, y, z + size.z / 2}, size / 2, paint, yaw_degrees);
  }
  // A slab between two corners that casts no shadow.
  void AddWall(Vec3d low, Vec3d high, Paint paint) {
    Add(Shape::kBox, (low + high) / 2, (high - low) / 2, paint).casts_shadow = false;
  }

  SyntheticScene Finish(Vec3d to_sun, Vec3d bounds_min, Vec3d bounds_max) {
    scene_.to_sun = Normalized(to_sun);
    scene_.bounds_min = bounds_min;
    scene_.bounds_max = bounds_max;
    return scene_;
  }

 private:
  SyntheticScene scene_;
  uint64_t seed_;
  double detail_;
  uint64_t num_paints_ = 0;
};

// Random numbers for shapes, the same in every run. Each call needs a statement of its own, or
// the shapes depend on the compiler.
class Dice {
 public:
  explicit Dice(uint64_t stream) : stream_(stream) {}

  double In(double low, double high) { return low + (high - low) * Next(); }
  bool Chance(double probability) { return Next() < probability; }
  // From 0 to n - 1.
  int Below(int n) { return static_cast<int>(RandomIndex(0, stream_, counter_++, n)); }

 private:
  double Next() { return RandomDouble(0, stream_, counter_++); }

  uint64_t stream_;
  uint64_t counter_ = 0;
};

}  // namespace regrade
