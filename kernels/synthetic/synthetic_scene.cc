#include "kernels/synthetic/synthetic_scene.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/scene/facing.h"
#include "kernels/synthetic/scene_builder.h"
#include "kernels/synthetic/street_scene.h"

namespace regrade {
namespace {

// Palettes: the ground first. Every scene has warm, cold and green hues.
constexpr Palette kStone = {0xd9d2c3, 0xb5644b, 0x4f7f8c, 0x8a8f5a, 0xc9a24f};
constexpr Palette kAzulejo = {0xdfe6e2, 0x3f6fa8, 0x5fa39b, 0xd9a441, 0x86b6cf};
constexpr Palette kLinen = {0xe3d7bd, 0xc2544d, 0xd98e5a, 0x7d9b76, 0x53627c};
constexpr Palette kCoral = {0xdd6b4d, 0xf1d9b0, 0xa83a38, 0xf0a868, 0x7c4a58};
constexpr Palette kTeal = {0x2f8f86, 0xd8e2c8, 0x1f5c66, 0x8cc7a8, 0xe0b04c};
constexpr Palette kMustard = {0xdba83a, 0xa8562f, 0xf0e0b4, 0x8c7a2e, 0x4e7a6b};
constexpr Palette kPlum = {0x7d5590, 0xc98fb6, 0x53386e, 0xe3c9a0, 0x4f7fa0};
constexpr Palette kLeaf = {0x6f9e52, 0xcad99a, 0x3f6e4a, 0xd9c25a, 0x8fb8a0};
constexpr Palette kSky = {0x5f93c4, 0xcfe0e8, 0x35618f, 0xe0a878, 0x8fc0c8};
constexpr Palette kOak = {0xb98a5e, 0xa5744a, 0xc79c6e, 0x946642, 0xb07d58};
constexpr Palette kPlaster = {0xd8c6a8, 0xc9a98a, 0xe6dcc6, 0xb9b49a, 0xa9bdb8};

SyntheticScene MakeTable(uint64_t seed) {
  SceneBuilder b("table", seed);
  const double radius = 1.55;
  b.AddWall({-radius, -radius, -0.08}, {radius, radius, 0},
            b.MakePaint(Pattern::kTerrazzo, 0.21, kStone));
  b.Add(Shape::kBackdrop, {0, 0, 0.72}, {radius, -0.35, 0.74},
        b.MakePaint(Pattern::kTiles, 0.34, kAzulejo))
      .casts_shadow = false;
  b.AddBlock(0.02, -0.12, 0, {1.5, 1.0, 0.012}, 14, b.MakePaint(Pattern::kCloth, 0.17, kLinen));
  b.AddBall(-0.27, -0.02, 0.012, 0.23, b.MakePaint(Pattern::kDots, 0.18, kCoral));
  b.AddBall(0.16, -0.42, 0.012, 0.13, b.MakePaint(Pattern::kPainting, 0.12, kTeal));
  b.AddBall(-0.17, -0.47, 0.012, 0.1, b.MakePaint(Pattern::kDots, 0.13, kMustard));
  b.AddBlock(0.42, 0.02, 0.012, {0.52, 0.38, 0.09}, -24,
             b.MakePaint(Pattern::kTerrazzo, 0.13, kLeaf));
  b.AddBlock(0.43, 0.03, 0.102, {0.44, 0.32, 0.08}, 8,
             b.MakePaint(Pattern::kCloth, 0.13, kCoral));
  b.AddBall(0.4, 0.0, 0.182, 0.11, b.MakePaint(Pattern::kDots, 0.12, kSky));
  b.AddPot(0.12, 0.52, 0, 0.17, 0.62, b.MakePaint(Pattern::kPainting, 0.18, kPlum));
  b.AddPot(-0.72, -0.2, 0, 0.13, 0.24, b.MakePaint(Pattern::kTiles, 0.16, kMustard));
  b.AddBlock(-0.62, 0.48, 0, {0.3, 0.3, 0.5}, 31, b.MakePaint(Pattern::kTiles, 0.2, kTeal));
  b.AddBall(-0.62, 0.48, 0.5, 0.12, b.MakePaint(Pattern::kTerrazzo, 0.12, kMustard));
  b.AddBlock(0.86, 0.42, 0, {0.28, 0.28, 0.3}, -37,
             b.MakePaint(Pattern::kPainting, 0.16, kSky));
  b.AddBall(0.78, -0.36, 0, 0.14, b.MakePaint(Pattern::kTerrazzo, 0.12, kPlum));
  b.AddBlock(-0.98, 0.2, 0, {0.22, 0.3, 0.2}, 20, b.MakePaint(Pattern::kDots, 0.16, kPlum));
  return b.Finish({-0.55, -0.6, 0.9}, {-radius, -radius, -0.08}, {radius, radius, 1.46});
}

SyntheticScene MakeWall(uint64_t seed) {
  SceneBuilder b("wall", seed);
  b.AddWall({-2.3, 0, -1.75}, {2.3, 0.08, 1.75},
            b.MakePaint(Pattern::kPainting, 0.26, kPlaster));
  // Two shelves with objects.
  b.AddBlock(-0.55, -0.17, -0.42, {1.7, 0.34, 0.07}, 0,
             b.MakePaint(Pattern::kPlanks, 0.16, kOak));
  b.AddBlock(0.95, -0.15, 0.28, {1.3, 0.3, 0.07}, 0, b.MakePaint(Pattern::kPlanks, 0.16, kOak));
  b.AddPot(-1.1, -0.17, -0.35, 0.13, 0.42, b.MakePaint(Pattern::kTiles, 0.17, kTeal));
  b.AddBall(-0.7, -0.18, -0.35, 0.14, b.MakePaint(Pattern::kDots, 0.14, kCoral));
  b.AddBlock(-0.3, -0.16, -0.35, {0.2, 0.2, 0.3}, 24, b.MakePaint(Pattern::kCloth, 0.1, kPlum));
  b.AddBall(0.08, -0.19, -0.35, 0.11, b.MakePaint(Pattern::kTerrazzo, 0.12, kMustard));
  b.AddBlock(0.5, -0.14, 0.35, {0.16, 0.2, 0.36}, 12,
             b.MakePaint(Pattern::kTerrazzo, 0.12, kSky));
  b.AddBall(0.85, -0.15, 0.35, 0.13, b.MakePaint(Pattern::kPainting, 0.12, kLeaf));
  b.AddPot(1.25, -0.15, 0.35, 0.11, 0.34, b.MakePaint(Pattern::kDots, 0.13, kMustard));
  // Pictures on the wall, and a tiled panel.
  b.AddBlock(-0.95, -0.04, 0.3, {0.9, 0.08, 0.68}, 0,
             b.MakePaint(Pattern::kPainting, 0.21, kSky));
  b.AddBlock(0.05, -0.03, 0.62, {0.5, 0.06, 0.5}, 0,
             b.MakePaint(Pattern::kCloth, 0.13, kCoral));
  b.AddBlock(1.2, -0.03, -0.95, {1.1, 0.06, 0.95}, 0,
             b.MakePaint(Pattern::kTiles, 0.29, kAzulejo));
  b.AddBlock(-1.75, -0.05, -0.25, {0.5, 0.1, 0.95}, 0,
             b.MakePaint(Pattern::kTerrazzo, 0.18, kPlum));
  b.AddBlock(1.85, -0.06, 0.3, {0.4, 0.12, 0.9}, 0, b.MakePaint(Pattern::kCloth, 0.16, kTeal));
  // A chest in front with objects on it.
  b.AddBlock(-0.5, -0.42, -1.6, {1.5, 0.5, 0.75}, 0, b.MakePaint(Pattern::kPlanks, 0.22, kOak));
  b.AddBall(-0.9, -0.45, -0.85, 0.16, b.MakePaint(Pattern::kPainting, 0.14, kMustard));
  b.AddBlock(-0.45, -0.45, -0.85, {0.34, 0.26, 0.12}, -18,
             b.MakePaint(Pattern::kDots, 0.14, kLeaf));
  b.AddPot(-0.05, -0.48, -0.85, 0.1, 0.26, b.MakePaint(Pattern::kTerrazzo, 0.12, kCoral));
  b.AddBall(0.45, -0.3, -1.6, 0.22, b.MakePaint(Pattern::kDots, 0.18, kTeal));
  return b.Finish({-0.5, -0.75, 0.75}, {-2.3, -0.7, -1.75}, {2.3, 0.08, 1.75});
}

SyntheticScene MakeSquare(uint64_t seed) {
  SceneBuilder b("square", seed);
  // Near: a pedestal with objects.
  b.AddPot(0, 0, -0.5, 0.95, 0.5, b.MakePaint(Pattern::kTerrazzo, 0.21, kStone));
  b.AddBall(-0.4, -0.3, 0, 0.24, b.MakePaint(Pattern::kDots, 0.18, kCoral));
  b.AddBlock(0.35, -0.3, 0, {0.4, 0.34, 0.3}, -24, b.MakePaint(Pattern::kCloth, 0.13, kTeal));
  b.AddBall(0.35, -0.3, 0.3, 0.15, b.MakePaint(Pattern::kTerrazzo, 0.12, kMustard));
  b.AddPot(0.05, 0.35, 0, 0.17, 0.66, b.MakePaint(Pattern::kPainting, 0.18, kPlum));
  b.AddBlock(-0.5, 0.3, 0, {0.3, 0.3, 0.48}, 31, b.MakePaint(Pattern::kTiles, 0.2, kSky));
  b.AddBall(0.55, 0.3, 0, 0.16, b.MakePaint(Pattern::kPainting, 0.14, kLeaf));
  // Far: paving, houses at 12 to 20, a dome of hills and clouds at 100.
  b.Add(Shape::kCylinder, {0, 0, -0.6}, {30, 0, 0.1}, b.MakePaint(Pattern::kTiles, 2.6, kStone))
      .casts_shadow = false;
  const Palette walls[] = {kCoral, kLinen, kTeal, kMustard, kPlum, kAzulejo};
  const Pattern patterns[] = {Pattern::kPainting, Pattern::kTiles, Pattern::kTerrazzo};
  for (int i = 0; i < 9; ++i) {
    const double angle = 2 * M_PI * (i + 0.3 * (i % 2)) / 9, away = 12 + 8.0 * (i * 4 % 9) / 8;
    b.AddBlock(away * std::cos(angle), away * std::sin(angle), -0.5,
               {3.0 + i % 3, 3.0, 3.5 + 1.5 * (i * 5 % 4)}, 40.0 * i,
               b.MakePaint(patterns[i % 3], 1.7, walls[i % 6]));
  }
  const double dome = 100;
  b.Add(Shape::kSphere, {0, 0, 0}, {dome, 0, 0}, b.MakePaint(Pattern::kPainting, 14, kSky))
      .casts_shadow = false;
  return b.Finish({-0.45, -0.55, 0.85}, {-dome, -dome, -dome}, {dome, dome, dome});
}

SyntheticScene MakeRoom(uint64_t seed) {
  SceneBuilder b("room", seed);
  const double x = 1.7, y = 1.5, h = 1.8, t = 0.06;  // half sides, height, thickness
  b.AddWall({-x, -y, -t}, {x, y, 0}, b.MakePaint(Pattern::kPlanks, 0.26, kOak));
  b.AddWall({-x, -y, h}, {x, y, h + t}, b.MakePaint(Pattern::kPainting, 0.29, kPlaster));
  b.AddWall({-x, y, 0}, {x, y + t, h}, b.MakePaint(Pattern::kTiles, 0.36, kAzulejo));
  b.AddWall({-x, -y - t, 0}, {x, -y, h}, b.MakePaint(Pattern::kCloth, 0.26, kLinen));
  b.AddWall({x, -y, 0}, {x + t, y, h}, b.MakePaint(Pattern::kTerrazzo, 0.29, kLeaf));
  b.AddWall({-x - t, -y, 0}, {-x, y, h}, b.MakePaint(Pattern::kPainting, 0.26, kCoral));
  // Along the north wall.
  b.AddBlock(0.3, 1.25, 0, {1.1, 0.4, 0.5}, 0, b.MakePaint(Pattern::kPlanks, 0.2, kMustard));
  b.AddBall(0.0, 1.24, 0.5, 0.16, b.MakePaint(Pattern::kDots, 0.18, kPlum));
  b.AddPot(0.55, 1.24, 0.5, 0.11, 0.36, b.MakePaint(Pattern::kPainting, 0.16, kTeal));
  b.AddBlock(-1.0, 1.3, 0, {0.5, 0.34, 1.25}, 0, b.MakePaint(Pattern::kTerrazzo, 0.23, kPlum));
  b.AddBlock(0.3, 1.47, 1.05, {0.9, 0.06, 0.55}, 0,
             b.MakePaint(Pattern::kPainting, 0.23, kMustard));
  // East.
  b.AddBlock(1.42, 0.35, 0, {0.45, 0.8, 0.42}, 0, b.MakePaint(Pattern::kCloth, 0.18, kTeal));
  b.AddBall(1.4, 0.55, 0.42, 0.18, b.MakePaint(Pattern::kTerrazzo, 0.16, kCoral));
  b.AddBlock(1.66, -0.2, 0.85, {0.08, 0.7, 0.6}, 0, b.MakePaint(Pattern::kTiles, 0.26, kSky));
  b.AddPot(1.4, -0.75, 0, 0.2, 0.7, b.MakePaint(Pattern::kDots, 0.21, kMustard));
  // South.
  b.AddBlock(0.2, -1.28, 0, {0.9, 0.36, 0.36}, 0, b.MakePaint(Pattern::kTiles, 0.23, kPlum));
  b.AddBlock(0.35, -1.3, 0.36, {0.34, 0.24, 0.28}, 17,
             b.MakePaint(Pattern::kPainting, 0.17, kLeaf));
  b.AddBlock(-0.2, -1.46, 0.85, {0.8, 0.08, 0.62}, 0, b.MakePaint(Pattern::kDots, 0.26, kSky));
  b.AddBall(-0.75, -1.22, 0, 0.24, b.MakePaint(Pattern::kPainting, 0.2, kMustard));
  // West.
  b.AddBlock(-1.45, -0.15, 0, {0.4, 0.9, 0.55}, 0, b.MakePaint(Pattern::kPlanks, 0.21, kSky));
  b.AddBall(-1.42, 0.1, 0.55, 0.17, b.MakePaint(Pattern::kDots, 0.17, kLeaf));
  b.AddBlock(-1.42, -0.4, 0.55, {0.26, 0.26, 0.3}, 28,
             b.MakePaint(Pattern::kCloth, 0.16, kMustard));
  b.AddBlock(-1.66, 0.65, 0.8, {0.08, 0.6, 0.7}, 0,
             b.MakePaint(Pattern::kTerrazzo, 0.22, kTeal));
  SyntheticScene scene =
      b.Finish({-0.35, -0.5, 0.8}, {-x - t, -y - t, -t}, {x + t, y + t, h + t});
  scene.sun = 0.7;  // light reflected between ceiling and walls
  scene.ambient = 0.6;
  return scene;
}

Camera LookAt(const Vec3d& center, const Vec3d& target, double focal_over_width, int width,
              int height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = focal_over_width * width;
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  const Vec3d forward = Normalized(target - center);
  const Vec3d right = Normalized(Cross(forward, Vec3d{0, 0, 1}));
  camera.camera_from_world = Facing(center, forward, right);
  return camera;
}

// Two heights of an arc: low from the middle to the right, back high from right to left, and
// back to the start: `turn` in [0, 1).
Camera TableCamera(double turn, int width, int height) {
  const double sway = turn < 0.25 ? 4 * turn : turn < 0.75 ? 2 - 4 * turn : 4 * turn - 4;
  const double azimuth = sway * 40 * M_PI / 180;
  const double lift = std::clamp(-2 * std::cos(2 * M_PI * turn), -1.0, 1.0);  // -1 low, 1 high
  const double distance = 2.2;
  const Vec3d center = {distance * std::sin(azimuth), -distance * std::cos(azimuth),
                        1.06 + 0.28 * lift};
  return LookAt(center, {0, 0.05, 0.24}, 1.15, width, height);
}

// A closed Lissajous figure fills a rectangle of a plane, shifted so that no two of 24 or 96
// positions coincide. The cameras turn inwards by a few degrees: views that differ by a
// translation alone leave the focal length undetermined.
Camera WallCamera(double turn, int width, int height) {
  const Vec3d center = {0.6 * std::sin(4 * M_PI * turn + 0.2), -2.7,
                        0.4 * std::sin(6 * M_PI * turn + 0.3)};
  return LookAt(center, {0.25 * center.x, 0, 0.25 * center.z}, 1.1, width, height);
}

// Once around and three times up and down.
Camera SquareCamera(double turn, int width, int height) {
  const double angle = 2 * M_PI * turn, distance = 2.2;
  const Vec3d center = {distance * std::sin(angle), -distance * std::cos(angle),
                        0.55 + 0.2 * std::sin(3 * angle)};
  return LookAt(center, {0, 0, 0.42}, 0.95, width, height);
}

Camera RoomCamera(double turn, int width, int height) {
  const double angle = 2 * M_PI * turn;
  const Vec3d center = {0.75 * std::sin(angle), -0.65 * std::cos(angle),
                        0.9 + 0.12 * std::sin(3 * angle)};
  return LookAt(center, {-0.5 * std::sin(angle), 0.5 * std::cos(angle), 0.8}, 0.9, width,
                height);
}

Camera StreetCamera(double turn, int width, int height) {
  const auto [center, target] = StreetViewpoint(turn);
  return LookAt(center, target, 0.9, width, height);
}

}  // namespace

SyntheticScene MakeSyntheticScene(const std::string& name, uint64_t seed) {
  if (name == "table") return MakeTable(seed);
  if (name == "wall") return MakeWall(seed);
  if (name == "room") return MakeRoom(seed);
  if (name == "square") return MakeSquare(seed);
  if (name == "street") return MakeStreet(seed);
  throw UsageError("there is no synthetic scene \"" + name + "\"", "--scene",
                   std::string("choose one of ") + kSyntheticSceneNames);
}

std::vector<Camera> SyntheticCameras(const SyntheticScene& scene, int views, int width,
                                     int height) {
  REGRADE_CHECK_GT(views, 0);
  REGRADE_CHECK_GT(width, 0);
  REGRADE_CHECK_GT(height, 0);
  std::vector<Camera> cameras;
  for (int i = 0; i < views; ++i) {
    const double turn = static_cast<double>(i) / views;
    cameras.push_back(scene.name == "table"    ? TableCamera(turn, width, height)
                      : scene.name == "wall"   ? WallCamera(turn, width, height)
                      : scene.name == "room"   ? RoomCamera(turn, width, height)
                      : scene.name == "street" ? StreetCamera(turn, width, height)
                                               : SquareCamera(turn, width, height));
  }
  return cameras;
}

}  // namespace regrade
