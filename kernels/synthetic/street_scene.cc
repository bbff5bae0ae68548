#include "kernels/synthetic/street_scene.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "kernels/synthetic/scene_builder.h"
#include "kernels/synthetic/street_house.h"

namespace regrade {
namespace {

// Metres. The mottle's smallest blobs are about 8 pixels wide at the far facade, in photos 800
// pixels wide.
constexpr double kStreetDetail = 0.08;
constexpr double kHalfLength = 150;
constexpr double kKerb = 6.5, kFront = 10;  // distances of kerb and facades from the middle
constexpr double kPavement = 0.14;          // its height
constexpr double kDome = 600;
constexpr double kCrossings[] = {-104, -31, 46, 118};  // of pedestrians

constexpr Palette kAsphalt = {0x77767a, 0x8c8a88, 0x605f64, 0x9b948a, 0x6c7076};
constexpr Palette kSlabs = {0xb3aca0, 0x9a9488, 0xc6c0b4, 0x8a8078, 0xa8a49e};
constexpr Palette kMarking = {0xdedbd0, 0xc4c0b4, 0xe8e6de, 0xb0aca2, 0xcfccc0};
constexpr Palette kGrass = {0x86955e, 0x6d7f4b, 0xa0a873, 0x94885c, 0x5d7046};
constexpr Palette kHills = {0x7d9568, 0x62805c, 0x9cab78, 0xb0a678, 0x527058};
constexpr Palette kClouds = {0xb8cfe6, 0xc6d8ea, 0xe0e8f0, 0xf4f6f8, 0x9cc0e2};
constexpr Palette kBark = {0x6e5a48, 0x55463a, 0x86705a, 0x453a32, 0x7a6a58};
constexpr Palette kFoliage[] = {{0x5d8a45, 0x86ad5c, 0x3f6b3a, 0xa9c26a, 0x4c7a4a},
                                {0x7a9a48, 0xa8bb5e, 0x567a3a, 0xcfc86a, 0x668a50},
                                {0x4d7a52, 0x72a06c, 0x345c44, 0x98b878, 0x5a8a68}};
constexpr Palette kIron = {0x47505a, 0x5c6670, 0x363d46, 0x748088, 0x505a60};
constexpr Palette kTimber = {0xa8804f, 0x8a6540, 0xc09a68, 0x745436, 0x98744c};
constexpr Palette kGlass = {0x35424c, 0x536874, 0x222c34, 0x7f97a2, 0x42525c};
constexpr Palette kRubber = {0x2e2e30, 0x8f9294, 0x3c3c40, 0x68686c, 0x262628};
constexpr Palette kCars[] = {{0xb23a36, 0xc85a50, 0x8e2a2a, 0xd88a70, 0xa04040},
                             {0x3a62a0, 0x5680ba, 0x2a4a80, 0x86a8d0, 0x4a6a98},
                             {0xd8d6ce, 0xbcbab2, 0xe8e6e0, 0xa2a09a, 0xcac4b8},
                             {0x4a7a60, 0x6a9a7c, 0x365e4a, 0x94b89a, 0x587a68},
                             {0xc89a38, 0xdcb860, 0xa47a28, 0xe8d090, 0xb48a40},
                             {0x6a6e76, 0x888c94, 0x50545c, 0xa4a8ae, 0x5e626a}};
constexpr Palette kGoods[] = {{0xc2544d, 0xe3d7bd, 0x8a3a38, 0xd98e5a, 0x53627c},
                              {0x2f8f86, 0xd8e2c8, 0x1f5c66, 0x8cc7a8, 0xe0b04c},
                              {0xdba83a, 0xa8562f, 0xf0e0b4, 0x8c7a2e, 0x4e7a6b},
                              {0x7d5590, 0xc98fb6, 0x53386e, 0xe3c9a0, 0x4f7fa0}};

// Brings the colours closer to the ground's.
Paint Softened(Paint paint) {
  for (Vec3d& color : paint.palette) color = (color + paint.palette[0]) * 0.5;
  return paint;
}

void AddGround(Dice& dice, SceneBuilder& b) {
  b.Add(Shape::kCylinder, {0, 0, -0.6}, {kDome - 1, 0, 0.4},
        b.MakePaint(Pattern::kPainting, 5, kGrass))
      .casts_shadow = false;
  const double end = kHalfLength + 16;
  b.AddWall({-end, -kKerb, -0.5}, {end, kKerb, 0},
            b.MakePaint(Pattern::kTerrazzo, 0.5, kAsphalt));
  for (const double side : {-1.0, 1.0}) {
    const auto strip = [&](double from, double to, double top, double reach, Paint paint) {
      b.AddWall({-reach, side > 0 ? from : -to, -0.5}, {reach, side > 0 ? to : -from, top},
                paint);
    };
    strip(kKerb - 0.1, kKerb + 0.15, kPavement + 0.02, end - 0.1,
          b.MakePaint(Pattern::kCloth, 0.5, kMarking));
    strip(kKerb, kFront + 4, kPavement, end - 0.2, b.MakePaint(Pattern::kTiles, 0.7, kSlabs));
  }
  // Markings, covers and patches, each a centimetre thick or two.
  for (double x = -kHalfLength + 4; x < kHalfLength; x += 7.5)
    b.AddBlock(x, 0, -0.1, {2.4, 0.14, 0.11}, 0,
               b.MakePaint(Pattern::kPainting, 0.3, kMarking));
  for (const double x : kCrossings)
    for (double y = -5.6; y < 6; y += 1.12)
      b.AddBlock(x, y, -0.1, {2.8, 0.5, 0.112}, 0,
                 b.MakePaint(Pattern::kPainting, 0.3, kMarking));
  for (double x = -kHalfLength + 9; x < kHalfLength; x += dice.In(7, 14)) {
    const double y = dice.In(-3.5, 3.5);
    if (dice.Chance(0.5)) {
      b.AddPot(x, y, -0.1, 0.34, 0.115, b.MakePaint(Pattern::kTiles, 0.17, kIron));
      continue;
    }
    const Vec3d size = {dice.In(1.2, 3), dice.In(0.6, 1.4), 0.107};
    b.AddBlock(x, y, -0.1, size, dice.In(-8, 8),
               b.MakePaint(Pattern::kTerrazzo, 0.35, kAsphalt));
  }
}

void AddHouses(Dice& dice, SceneBuilder& b) {
  for (const double side : {-1.0, 1.0})
    for (double x = -kHalfLength; x < kHalfLength - 4;) {
      HouseLot lot;
      lot.width = dice.In(6.5, 11.5);
      lot.depth = dice.In(8, 11);
      lot.storeys = 2 + dice.Below(3);
      lot.front = {x + 0.5 * lot.width, side * (kFront + dice.In(0, 0.9)), kPavement - 0.02};
      lot.yaw_degrees = side > 0 ? 0 : 180;
      AddHouse(lot, dice, b);
      x += lot.width + (dice.Chance(0.2) ? dice.In(1.5, 2.6) : 0);
    }
  // Across both ends.
  for (const double end : {-1.0, 1.0})
    for (int i = -2; i <= 2; ++i) {
      HouseLot lot;
      lot.width = 12.4;
      lot.depth = 10;
      lot.storeys = 3 + dice.Below(2);
      lot.front = {end * (kHalfLength + 17 + dice.In(0, 0.8)), 12.4 * i, -0.22};
      lot.yaw_degrees = end > 0 ? -90 : 90;
      AddHouse(lot, dice, b);
    }
}

// What shows above the roofs and through the gaps.
void AddDistance(Dice& dice, SceneBuilder& b) {
  for (const double side : {-1.0, 1.0})
    for (double x = -kHalfLength - 30; x < kHalfLength + 30; x += dice.In(17, 25)) {
      const Pattern pattern = dice.Chance(0.6) ? Pattern::kTiles : Pattern::kPainting;
      Paint paint = b.MakePaint(pattern, 2.4, kGoods[dice.Below(4)]);
      for (Vec3d& color : paint.palette) color = color * 0.4 + Vec3d{0.3, 0.3, 0.32};
      paint.detail = 0.4;
      const double y = side * dice.In(32, 55);
      const Vec3d size = {dice.In(10, 16), dice.In(9, 13), dice.In(10, 27)};
      b.AddBlock(x, y, -1, size, dice.In(-12, 12), paint);
    }
  for (int i = 0; i < 11; ++i) {
    const double angle = 2 * M_PI * (i + dice.In(0, 0.5)) / 11, rise = dice.In(30, 62);
    const double across = 220, radius = 230;
    Paint paint = b.MakePaint(Pattern::kPainting, 9, kHills);
    paint.detail = 2;
    b.Add(Shape::kSphere,
          {(kHalfLength + across) * std::cos(angle), 1.25 * across * std::sin(angle),
           rise - radius},
          {radius, 0, 0}, paint)
        .casts_shadow = false;
  }
  Paint paint = Softened(b.MakePaint(Pattern::kPainting, 45, kClouds));
  paint.detail = 5;
  b.Add(Shape::kSphere, {0, 0, 0}, {kDome, 0, 0}, paint).casts_shadow = false;
}

void AddTree(double x, double y, Dice& dice, SceneBuilder& b) {
  const double height = dice.In(2.9, 3.6);
  b.Add(Shape::kCylinder, {x, y, kPavement + 0.5 * height - 0.1}, {0.17, 0, 0.5 * height + 0.1},
        b.MakePaint(Pattern::kTerrazzo, 0.25, kBark));
  b.AddBlock(x, y, kPavement - 0.1, {1.1, 1.1, 0.13}, 0,
             b.MakePaint(Pattern::kTiles, 0.25, kIron));
  const Palette& leaves = kFoliage[dice.Below(3)];
  const double turn = dice.In(0, 2 * M_PI);
  for (int i = 0; i < 6; ++i) {
    const double angle = turn + 2 * M_PI * i / 5, away = i < 5 ? dice.In(0.65, 0.95) : 0;
    const double rise = i < 5 ? dice.In(0.1, 0.8) : 1.3, radius = dice.In(0.75, 1.05);
    b.Add(Shape::kSphere,
          {x + away * std::cos(angle), y + away * std::sin(angle), kPavement + height + rise},
          {radius, 0, 0},
          b.MakePaint(i % 2 ? Pattern::kDots : Pattern::kTerrazzo, 0.33, leaves));
  }
}

void AddCar(double x, double y, Dice& dice, SceneBuilder& b) {
  const Palette& colors = kCars[dice.Below(6)];
  const double length = dice.In(3.7, 4.5), front = dice.Chance(0.5) ? 1 : -1;
  const double cabin = x - front * 0.06 * length;
  const auto paint = [&] { return Softened(b.MakePaint(Pattern::kPainting, 0.4, colors)); };
  b.AddBlock(x, y, 0.24, {length, 1.7, 0.6}, 0, paint());
  b.AddBlock(cabin, y, 0.8, {0.52 * length, 1.5, 0.5}, 0,
             b.MakePaint(Pattern::kCloth, 0.4, kGlass));
  b.AddBlock(cabin, y, 1.28, {0.46 * length, 1.42, 0.13}, 0, paint());
  for (const double side : {-0.78, 0.78})
    for (const double along : {-0.24, 0.03, 0.25})
      b.AddBlock(cabin + along * length, y + side * 0.955, 0.82, {0.1, 0.06, 0.5}, 0, paint());
  for (const double end : {-1.0, 1.0}) {
    b.AddBlock(x + end * 0.5 * length, y, 0.3, {0.16, 1.62, 0.2}, 0,
               b.MakePaint(Pattern::kTerrazzo, 0.3, kIron));
    for (const double side : {-1.0, 1.0}) {
      b.Add(Shape::kSphere, {x + end * 0.31 * length, y + side * 0.68, 0.315}, {0.315, 0, 0},
            b.MakePaint(Pattern::kDots, 0.25, kRubber));
      b.AddBlock(x + end * 0.5 * length, y + side * 0.6, 0.58, {0.05, 0.28, 0.14}, 0,
                 b.MakePaint(Pattern::kTiles, 0.1, end == front ? kMarking : kCars[0]));
    }
  }
}

void AddBench(double x, double y, double side, SceneBuilder& b) {
  for (const double along : {-0.6, 0.6})
    b.AddBlock(x + along, y, kPavement - 0.1, {0.1, 0.4, 0.55}, 0,
               b.MakePaint(Pattern::kTerrazzo, 0.2, kIron));
  b.AddBlock(x, y, kPavement + 0.44, {1.7, 0.46, 0.07}, 0,
             b.MakePaint(Pattern::kPlanks, 0.15, kTimber));
  b.AddBlock(x, y + side * 0.22, kPavement + 0.5, {1.7, 0.06, 0.45}, 0,
             b.MakePaint(Pattern::kPlanks, 0.15, kTimber));
}

void AddLamp(double x, double y, SceneBuilder& b) {
  b.AddPot(x, y, kPavement - 0.1, 0.16, 0.7, b.MakePaint(Pattern::kTiles, 0.2, kIron));
  b.AddPot(x, y, kPavement, 0.065, 4.1, b.MakePaint(Pattern::kTerrazzo, 0.2, kIron));
  b.AddBall(x, y, kPavement + 4.02, 0.24, b.MakePaint(Pattern::kPainting, 0.2, kMarking));
}

// A stack of crates, a pot with a bush, or bollards.
void AddThing(double x, double y, Dice& dice, SceneBuilder& b) {
  const int kind = dice.Below(3);
  const auto goods = [&](Pattern pattern) {
    return b.MakePaint(pattern, 0.22, kGoods[dice.Below(4)]);
  };
  if (kind == 0) {
    const double foot = kPavement - 0.05, turn = dice.In(-20, 20);
    b.AddBlock(x, y, foot, {0.7, 0.5, 0.45}, turn, goods(Pattern::kPlanks));
    b.AddBlock(x + 0.85, y, foot, {0.6, 0.5, 0.6}, 0.4 * turn, goods(Pattern::kTiles));
    b.AddBlock(x + 0.05, y, foot + 0.45, {0.5, 0.42, 0.36}, -turn, goods(Pattern::kCloth));
  } else if (kind == 1) {
    b.AddPot(x, y, kPavement - 0.05, 0.36, 0.6, goods(Pattern::kTiles));
    for (const double side : {-0.16, 0.16})
      b.Add(Shape::kSphere, {x + side, y + 0.5 * side, kPavement + 0.78 + side}, {0.36, 0, 0},
            b.MakePaint(Pattern::kDots, 0.2, kFoliage[dice.Below(3)]));
  } else {
    for (const double along : {-0.8, 0.0, 0.8})
      b.AddPot(x + along, y, kPavement - 0.1, 0.1, 1.0,
               b.MakePaint(Pattern::kCloth, 0.2, kIron));
  }
}

void AddFurniture(Dice& dice, SceneBuilder& b) {
  for (const double side : {-1.0, 1.0}) {
    for (double x = -kHalfLength + dice.In(2, 6); x < kHalfLength - 3; x += dice.In(12, 15)) {
      AddTree(x, side * (kKerb + 0.85), dice, b);
      AddLamp(x + 5.6, side * (kKerb + 0.5), b);
      if (dice.Chance(0.5)) AddBench(x + 2.4, side * (kKerb + 0.7), side, b);
      if (dice.Chance(0.8)) AddThing(x + 7.5, side * (kKerb + 0.75), dice, b);
      if (dice.Chance(0.4)) AddThing(x + 3.4, side * (kFront - 0.95), dice, b);
    }
    for (double x = -kHalfLength + 4; x < kHalfLength - 4; x += dice.In(5.6, 6.6))
      if (dice.Chance(0.6) &&
          std::ranges::none_of(kCrossings, [&](double c) { return std::abs(x - c) < 4; }))
        AddCar(x, side * (kKerb - 1.15), dice, b);
  }
}

}  // namespace

SyntheticScene MakeStreet(uint64_t seed) {
  SceneBuilder b("street", seed, kStreetDetail);
  Dice houses(1), furniture(2), surroundings(3);
  AddGround(surroundings, b);
  AddHouses(houses, b);
  AddFurniture(furniture, b);
  AddDistance(surroundings, b);
  SyntheticScene scene =
      b.Finish({-0.5, -0.5, 0.9}, {-kDome, -kDome, -kDome}, {kDome, kDome, kDome});
  scene.sun = 0.85;
  scene.ambient = 0.68;  // light reflected by the houses across
  return scene;
}

std::pair<Vec3d, Vec3d> StreetViewpoint(double turn) {
  // At the ends, where the camera turns to the other facade, photos are closer to each other.
  constexpr double kBend = 0.95, kReach = 132, kLane = 2.2;
  const double angle = 2 * M_PI * turn, sine = std::sin(angle);
  const Vec3d center = {
      -kReach * std::asin(kBend * std::cos(angle)) / std::asin(kBend),
      -kLane * sine / std::sqrt(0.97 * sine * sine + 0.03) + 0.25 * std::sin(6 * angle + 1),
      1.75 + 0.2 * std::sin(10 * angle)};
  // The direction from the x axis, counterclockwise: halfway up the street 45 degrees, to the
  // far facade on the left; around the ends clockwise, so that it passes the nearer facade,
  // too.
  const double since = angle - 0.5 * M_PI;
  const double heading =
      0.25 * M_PI - (since - 0.5 * std::sin(2 * since)) + 0.12 * std::sin(12 * angle);
  const Vec3d forward = {std::cos(heading), std::sin(heading),
                         0.1 + 0.04 * std::sin(6 * angle)};
  return {center, center + forward};
}

}  // namespace regrade
