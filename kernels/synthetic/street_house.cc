#include "kernels/synthetic/street_house.h"

#include <algorithm>
#include <cmath>

namespace regrade {
namespace {

constexpr Palette kHouseWalls[] = {{0xd8b48a, 0xb98258, 0xe6cfa6, 0x9a6a4c, 0xc7a070},
                                   {0xb5604a, 0x8f4436, 0xcf8166, 0xdab79a, 0x74392f},
                                   {0xe2d9c4, 0xb9ad92, 0xf0ead8, 0xa8916d, 0xc9b28a},
                                   {0x8fa6a8, 0x64807f, 0xb7c8c4, 0xd8d2bd, 0x4e666a},
                                   {0xcfa24a, 0xa87a30, 0xe5c77f, 0x8a6a3c, 0xd8b564},
                                   {0x9fb08a, 0x768a63, 0xc7d1ae, 0x5d7052, 0xb9a878},
                                   {0xc98f86, 0xa4665f, 0xe2b9ac, 0x844c4a, 0xd7a596},
                                   {0x8d86a6, 0x665f80, 0xb4aec8, 0xd3c9c2, 0x504b68},
                                   {0x7f9dbd, 0x587899, 0xacc3d8, 0xdde0dc, 0x41607f},
                                   {0xa89a8c, 0x7f7264, 0xc9beb0, 0x62574c, 0xb5a48c}};
constexpr Palette kHousePanes[] = {{0x3d4c59, 0x6d8496, 0x27323c, 0xb9c6c9, 0x55656b},
                                   {0x4a4038, 0x8b7355, 0x2c2723, 0xcbb98f, 0x6a5a49},
                                   {0x3a4a48, 0x84a09a, 0x1f2d2c, 0xd9cfae, 0x5c7470},
                                   {0x57495c, 0xa08ba6, 0x2f2733, 0xd8c7c4, 0x735f70}};
constexpr Palette kHouseTrims[] = {{0xe9e4d6, 0xcfc6b2, 0xf4f1e8, 0xb9ae98, 0xdcd4c2},
                                   {0x8a6a4a, 0x6b4e34, 0xa98660, 0x54402e, 0x957452},
                                   {0x4d6b62, 0x35504a, 0x6f8d80, 0x8aa396, 0x2c423d},
                                   {0x9c9a94, 0x7b7972, 0xb9b7b0, 0x63615b, 0xa8a49a}};
constexpr Palette kHouseDoors[] = {{0x7a2f2a, 0x9c4a3c, 0x5a211e, 0xb98a5a, 0x8a3b33},
                                   {0x2f5a4a, 0x47765f, 0x21443a, 0xc2a860, 0x386655},
                                   {0x2f4a78, 0x48679a, 0x22365a, 0xc9b27a, 0x3b5888},
                                   {0x8a6038, 0xa77c4e, 0x6a4828, 0x4f3820, 0x946a40}};
constexpr Palette kHouseAwnings[] = {{0xe8e0cc, 0xb8423a, 0xcf6a50, 0x8e302c, 0xf0d9b0},
                                     {0xe4e2d0, 0x3f7a5c, 0x6aa07e, 0x2c5a44, 0xd9c78a},
                                     {0xe6e4dc, 0x3d68a0, 0x7fa3c8, 0x284878, 0xe0b864}};
constexpr Palette kHousePlants = {0x5f8a4a, 0xd25a5a, 0x3f6a3c, 0xe2b84a, 0x8fb070};

// Puts boxes on a facade and knows what it is painted with.
class Facade {
 public:
  Facade(const HouseLot& lot, Dice& dice, SceneBuilder& b)
      : lot_(lot),
        cosine_(std::cos(lot.yaw_degrees * M_PI / 180)),
        sine_(std::sin(lot.yaw_degrees * M_PI / 180)),
        dice_(dice),
        b_(b),
        trim_(kHouseTrims[dice.Below(4)]),
        pane_(kHousePanes[dice.Below(4)]),
        frame_(dice.Below(3)) {}

  // A point `along` the facade and `out` of it.
  Vec3d At(double along, double out, double z) const {
    return {lot_.front.x + cosine_ * along + sine_ * out,
            lot_.front.y + sine_ * along - cosine_ * out, lot_.front.z + z};
  }
  // A box from `back` to `out` before the wall, with its foot at z; `along` is its middle.
  void AddBox(double along, double back, double out, double z, double width, double height,
              const Paint& paint) {
    const Vec3d foot = At(along, 0.5 * (back + out), z);
    b_.AddBlock(foot.x, foot.y, foot.z, {width, out - back, height}, lot_.yaw_degrees, paint);
  }
  // A box on a wall that itself stands out by `wall`.
  void AddRelief(double wall, double along, double z, double width, double height, double out,
                 const Paint& paint) {
    AddBox(along, wall - 0.06, wall + out, z, width, height, paint);
  }
  Paint Trim(double size = 0.3) { return b_.MakePaint(Pattern::kTerrazzo, size, trim_); }

  // `z`: of the pane's lower edge.
  void AddWindow(double wall, double along, double z, double width, double height) {
    AddRelief(
        wall, along, z, width + 0.02, height, 0.03,
        b_.MakePaint(dice_.Chance(0.3) ? Pattern::kPainting : Pattern::kCloth, 0.3, pane_));
    AddRelief(wall, along, z - 0.1, width + 0.36, 0.11, 0.22, Trim());
    AddRelief(wall, along, z + height - 0.01, width + 0.28, 0.2, 0.14, Trim());
    if (frame_ == 0) return;
    for (const double side : {-1.0, 1.0})
      if (frame_ == 1)
        AddRelief(wall, along + side * (0.5 * width + 0.05), z, 0.1, height, 0.1, Trim());
      else
        AddRelief(wall, along + side * 0.77 * width, z + 0.03, 0.5 * width, height - 0.05, 0.07,
                  b_.MakePaint(Pattern::kPlanks, 0.16, trim_));
    if (frame_ == 1) AddRelief(wall, along, z, 0.07, height, 0.06, Trim());
  }

  void AddDoor(double along, double height) {
    AddRelief(0, along, 0, 1.12, height, 0.04,
              b_.MakePaint(Pattern::kPlanks, 0.28, kHouseDoors[dice_.Below(4)]));
    for (const double side : {-0.65, 0.65})
      AddRelief(0, along + side, 0, 0.2, height + 0.05, 0.16, Trim());
    AddRelief(0, along, height - 0.01, 1.7, 0.3, 0.24, Trim());
    AddRelief(0, along, 0, 1.6, 0.13, 0.62, Trim(0.3));
    AddRelief(0, along, 0.12, 1.45, 0.12, 0.34, Trim(0.3));
  }

  // A shop's window between two places, with an awning.
  void AddShop(double from, double to, double height) {
    const double along = 0.5 * (from + to), width = to - from;
    AddRelief(0, along, 0.5, width, height - 0.5, 0.03,
              b_.MakePaint(Pattern::kCloth, 0.35, pane_));
    AddRelief(0, along, 0.38, width + 0.2, 0.14, 0.3, Trim());
    const int bars = std::max(1, static_cast<int>(width / 1.6));
    for (int i = 0; i <= bars; ++i)
      AddRelief(0, from + width * i / bars, 0.5, 0.1, height - 0.5, 0.12, Trim());
    const Palette& colors = kHouseAwnings[dice_.Below(3)];
    AddRelief(0, along, height - 0.01, width + 0.2, 0.5, 0.18,
              b_.MakePaint(Pattern::kTiles, 0.45, colors));
    if (dice_.Chance(0.6))
      AddRelief(0, along, height - 0.16, width - 0.1, 0.1, 1.25,
                b_.MakePaint(Pattern::kCloth, 0.22, colors));
  }

  void AddBalcony(double along, double z, double width) {
    const double out = 0.85;
    AddRelief(0, along, z - 0.14, width, 0.14, out, Trim());
    const Paint rail = b_.MakePaint(Pattern::kTerrazzo, 0.3, trim_);
    AddBox(along, out - 0.1, out - 0.03, z + 0.9, width - 0.06, 0.07, rail);
    for (const double side : {-1.0, 1.0})
      AddBox(along + side * (0.5 * width - 0.065), -0.06, out - 0.11, z + 0.91, 0.06, 0.05,
             rail);
    const int posts = static_cast<int>(width / 0.3);
    for (int i = 0; i <= posts; ++i) {
      const Vec3d foot = At(along + (width - 0.13) * (1.0 * i / posts - 0.5), out - 0.065, z);
      b_.Add(Shape::kCylinder, foot + Vec3d{0, 0, 0.45}, {0.025, 0, 0.45}, rail);
    }
  }

  void AddFlowers(double along, double z, double width) {
    AddRelief(0.1, along, z, width, 0.18, 0.2, b_.MakePaint(Pattern::kPlanks, 0.15, trim_));
    for (int i = 0; i < 3; ++i)
      b_.Add(Shape::kSphere, At(along + width * 0.32 * (i - 1), 0.19, z + 0.22),
             {dice_.In(0.13, 0.18), 0, 0}, b_.MakePaint(Pattern::kDots, 0.1, kHousePlants));
  }

 private:
  const HouseLot& lot_;
  double cosine_, sine_;
  Dice& dice_;
  SceneBuilder& b_;
  const Palette& trim_;
  const Palette& pane_;
  int frame_;  // of windows: none, jambs with a mullion, shutters
};

// What stands on the roof at height z.
void AddRoof(const HouseLot& lot, double z, const Facade& facade, Dice& dice, SceneBuilder& b) {
  const auto block = [&](double along, double back, double foot, Vec3d size, Pattern pattern) {
    const Vec3d at = facade.At(along, -back, foot);
    b.AddBlock(at.x, at.y, at.z, size, lot.yaw_degrees,
               b.MakePaint(pattern, 0.6, kHouseWalls[dice.Below(10)]));
  };
  double top = z;
  if (dice.Chance(0.6)) {
    const double height = dice.In(1.2, 2.3);
    block(0, 0.5 * lot.depth, z - 0.05, {lot.width - 0.9, lot.depth - 1.6, height},
          Pattern::kTiles);
    for (double along = -0.5 * lot.width + 1.7; along < 0.5 * lot.width - 1.4; along += 2.6)
      block(along, 0.85, z - 0.04, {1.1, 0.9, std::min(1.35, height - 0.1)}, Pattern::kPlanks);
    top += height - 0.1;
  }
  for (int i = dice.Below(3); i >= 0; --i) {
    const double along = (i - 0.8) * 0.3 * lot.width, back = dice.In(2, lot.depth - 2);
    const double height = dice.In(0.9, 1.6);
    block(along, back, top - 0.1, {0.8, 0.6, height}, Pattern::kTerrazzo);
    for (const double side : {-0.2, 0.2}) {
      const Vec3d pot = facade.At(along + side, -back, top - 0.1 + height);
      b.AddPot(pot.x, pot.y, pot.z - 0.02, 0.12, 0.42,
               b.MakePaint(Pattern::kTerrazzo, 0.2, kHouseWalls[1]));
    }
  }
}

}  // namespace

void AddHouse(const HouseLot& lot, Dice& dice, SceneBuilder& b) {
  constexpr Pattern kWalls[] = {Pattern::kTiles,  Pattern::kTerrazzo, Pattern::kPlanks,
                                Pattern::kPlanks, Pattern::kCloth,    Pattern::kPainting};
  Facade facade(lot, dice, b);
  const double ground = dice.In(3.3, 3.8), storey = dice.In(2.9, 3.3);
  const double height = ground + storey * (lot.storeys - 1) + 0.5;
  const Palette& wall = kHouseWalls[dice.Below(10)];
  const Pattern pattern = kWalls[dice.Below(6)];
  facade.AddBox(0, -lot.depth, 0, -0.4, lot.width + 0.02, height + 0.4,
                b.MakePaint(pattern, dice.In(0.35, 0.8), wall));
  facade.AddRelief(0, 0, -0.4, lot.width - 0.05, dice.In(0.75, 0.98), 0.05, facade.Trim(0.4));
  facade.AddRelief(0, 0, height - 0.3, lot.width - 0.04, 0.36, 0.34, facade.Trim());
  facade.AddRelief(0, 0, height - 0.5, lot.width - 0.07, 0.21, 0.18, facade.Trim());
  for (int s = 1; s < lot.storeys; ++s)
    facade.AddRelief(0, 0, ground + storey * (s - 1) - 0.1, lot.width - 0.06, 0.14, 0.08,
                     facade.Trim());
  if (dice.Chance(0.35))
    for (const double side : {-1.0, 1.0})
      facade.AddRelief(0, side * (0.5 * lot.width - 0.25), -0.3, 0.34, height - 0.1, 0.12,
                       facade.Trim(0.7));
  AddRoof(lot, height, facade, dice, b);

  const int columns = std::max(2, static_cast<int>((lot.width - 0.6) / dice.In(2.2, 2.8)));
  const double pitch = (lot.width - 0.8) / columns;
  const auto place = [&](int column) { return pitch * (column + 0.5 - 0.5 * columns); };
  const double width = std::min(1.25, 0.42 * pitch + 0.1), tall = dice.In(1.5, 1.8);

  // The ground floor: a door, and a shop or windows.
  const int door = dice.Chance(0.5) ? 0 : columns - 1;
  facade.AddDoor(place(door), 2.4);
  const bool shop = dice.Chance(0.35);
  if (shop)
    facade.AddShop(place(door == 0 ? 1 : 0) - 0.42 * pitch,
                   place(door == 0 ? columns - 1 : columns - 2) + 0.42 * pitch, 2.75);
  for (int c = 0; !shop && c < columns; ++c)
    if (c != door) facade.AddWindow(0, place(c), 1.05, width, 1.5);

  // Above: windows, one column of them in a bay, some with a balcony or flowers.
  const int bay = lot.storeys > 2 && dice.Chance(0.4) ? dice.Below(columns) : -1;
  const double out = 0.7;
  if (bay >= 0) {
    const Pattern of_bay = kWalls[dice.Below(6)];
    const double bay_width = std::min(pitch - 0.2, width + 0.9);
    const double top = ground + storey * (lot.storeys - 1) - 0.2;
    facade.AddRelief(0, place(bay), ground + 0.15, bay_width, top - ground - 0.15, out,
                     b.MakePaint(of_bay, 0.5, kHouseWalls[dice.Below(10)]));
    facade.AddRelief(0, place(bay), ground - 0.2, bay_width - 0.4, 0.36, out - 0.3,
                     facade.Trim());
    facade.AddRelief(0, place(bay), top - 0.03, bay_width + 0.2, 0.16, out + 0.12,
                     facade.Trim());
  }
  for (int s = 1; s < lot.storeys; ++s)
    for (int c = 0; c < columns; ++c) {
      const double floor = ground + storey * (s - 1);
      if (c == bay) {
        facade.AddWindow(out, place(c), floor + 0.75, std::min(width, 0.9), tall - 0.1);
      } else if (dice.Chance(0.16)) {
        facade.AddWindow(0, place(c), floor + 0.1, width, tall + 0.65);
        facade.AddBalcony(place(c), floor + 0.06, std::min(pitch - 0.3, width + 0.8));
      } else {
        facade.AddWindow(0, place(c), floor + 0.8, width, tall);
        if (dice.Chance(0.2)) facade.AddFlowers(place(c), floor + 0.81, width - 0.1);
      }
    }
}

}  // namespace regrade
