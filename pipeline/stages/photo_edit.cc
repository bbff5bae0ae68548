#include "pipeline/stages/photo_edit.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"
#include "pipeline/images/edge_shift.h"
#include "pipeline/stages/photo_vignette.h"
#include "stylize/fit_color_table.h"
#include "stylize/image/guided_filter.h"
#include "stylize/image/view_stylizer.h"

namespace regrade {
namespace {

constexpr int kTable = 33, kDraftTable = 17;
constexpr double kTableSmoothness = 0.1, kMostSmoothness = 1e5;
constexpr double kSteepestMap = 8;
constexpr double kMapLeaves = 0.5;  // of the edit's variation, at most, beside a local part
constexpr int kTurns = 6;           // of fitting the map and the vignette
constexpr double kLocalStep = 2.0 / 255, kLocalShare = 0.2;

ColorTable FitTable(const Image& photo, const Image& edited, const Vignette& vignette, int size,
                    int64_t stride, double smoothness = kTableSmoothness) {
  TableFit fit(size);
  for (int64_t i = 0; i < photo.num_pixels(); i += stride)
    fit.Add(ColorAt(photo, i), ColorAt(edited, i) * (1 / vignette(SquaredRadius(photo, i))));
  return fit.Solve(smoothness);
}

// As smooth as it takes to be no steeper than a photographer's curves: one that is steeper
// tears apart the like colours of an edited object and of what is not edited.
ColorTable FitGentleTable(const Image& photo, const Image& edited, const Vignette& vignette,
                          int64_t stride) {
  ColorTable table;
  for (double smoothness = kTableSmoothness; smoothness <= kMostSmoothness; smoothness *= 10) {
    table = FitTable(photo, edited, vignette, kTable, stride, smoothness);
    if (SteepestSlope(table, kSteepestMap) <= kSteepestMap) break;
  }
  return table;
}

Image Mapped(const Image& photo, const ColorTable& table) {
  Image mapped = photo;
  for (int64_t i = 0; i < photo.num_pixels(); ++i) {
    const Vec3d m = table(ColorAt(photo, i));
    for (int c = 0; c < 3; ++c)
      mapped.pixels[static_cast<size_t>(3 * i + c)] = static_cast<float>(m[c]);
  }
  return mapped;
}

// What is left of the edit without its vignette.
Image Residual(const Image& mapped, const Image& edited, const Vignette& vignette) {
  Image residual = mapped;
  for (int64_t i = 0; i < mapped.num_pixels(); ++i) {
    const Vec3d r =
        ColorAt(edited, i) * (1 / vignette(SquaredRadius(mapped, i))) - ColorAt(mapped, i);
    for (int c = 0; c < 3; ++c)
      residual.pixels[static_cast<size_t>(3 * i + c)] = static_cast<float>(r[c]);
  }
  return residual;
}

Image LowPass(const Image& image) {
  const int step = std::max(2, std::max(image.width, image.height) / 64);
  const Image small =
      Resize(image, std::max(1, image.width / step), std::max(1, image.height / step));
  return Resize(small, image.width, image.height);
}

double MeanSquare(const Image& image) {
  double sum = 0;
  for (const float v : image.pixels) sum += double{v} * double{v};
  return sum / std::max<double>(1, static_cast<double>(image.pixels.size()));
}

Image Minus(Image a, const Image& b) {
  for (size_t i = 0; i < a.pixels.size(); ++i) a.pixels[i] -= b.pixels[i];
  return a;
}

// The photo's own detail finer than two pixels: the band that sharpening raises.
Image DetailLayer(const Image& image) {
  const Image half = Resize(image, std::max(1, image.width / 2), std::max(1, image.height / 2));
  return Minus(image, Resize(half, image.width, image.height));
}

// The sum over pixels and channels of the steps to the next pixel.
double Variation(const Image& image) {
  double sum = 0;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x)
      for (int c = 0; c < 3; ++c) {
        const float own = image.at(x, y)[c];
        if (x + 1 < image.width) sum += std::abs(double{image.at(x + 1, y)[c] - own});
        if (y + 1 < image.height) sum += std::abs(double{image.at(x, y + 1)[c] - own});
      }
  return sum;
}

// What is left of an edit behind its map, without sharpening and grain, with the photo's edges.
Image LayerOf(const Image& photo, const Image& residual, const Image& fine, double sharpening) {
  constexpr double kEps = 0.02 * 0.02;
  const int radius = std::max(1, std::max(photo.width, photo.height) / 128);
  Image left = residual;
  for (size_t i = 0; i < left.pixels.size(); ++i)
    left.pixels[i] -= static_cast<float>(sharpening) * fine.pixels[i];
  Image layer = ApplyGuided(FitGuided(photo, left, radius, kEps), photo);
  for (float& v : layer.pixels) v = std::clamp(v, -1.0f, 1.0f);
  return layer;
}

}  // namespace

bool PhotoEdit::IsLocal() const { return local > kLocalStep && local > kLocalShare * change; }

PhotoEdit AnalyseEdit(const Image& photo_given, const Image& edited_given) {
  const Image photo = Colors(photo_given), edited = Colors(edited_given);
  REGRADE_CHECK(photo.SameSize(edited));
  const int64_t stride = std::max<int64_t>(1, photo.num_pixels() / 10000);
  PhotoEdit edit;
  edit.change = std::sqrt(MeanSquare(Minus(edited, photo)));

  const ColorTable plain = FitTable(photo, edited, {}, kDraftTable, stride);
  const Image of_plain = Mapped(photo, plain);
  const double left_without = MeanSquare(LowPass(Residual(of_plain, edited, {})));
  Vignette vignette = FitVignette(MeasureRings(of_plain, edited));
  Rings rings;
  for (int turn = 0; turn < kTurns; ++turn) {
    const Image mapped = Mapped(photo, FitTable(photo, edited, vignette, kDraftTable, stride));
    rings = MeasureRings(mapped, edited);
    vignette = FitVignette(rings);
  }
  Image mapped = Mapped(photo, FitTable(photo, edited, vignette, kDraftTable, stride));
  const double left = MeanSquare(LowPass(Residual(mapped, edited, vignette)));
  if (!IsVignette(rings, vignette, left, left_without)) vignette = {};
  edit.vignette = vignette;

  edit.table = FitGentleTable(photo, edited, vignette, std::max<int64_t>(1, stride / 6));
  mapped = Mapped(photo, edit.table);
  const Image residual = Residual(mapped, edited, vignette), low = LowPass(residual);
  edit.local = std::sqrt(MeanSquare(low));
  const Image fine = DetailLayer(mapped), above = DetailLayer(Minus(residual, low));
  double product = 0, square = 0;
  for (size_t i = 0; i < fine.pixels.size(); ++i) {
    product += double{fine.pixels[i]} * double{above.pixels[i]};
    square += double{fine.pixels[i]} * double{fine.pixels[i]};
  }
  edit.sharpening = square > 0 ? product / square : 0;
  const double rest = MeanSquare(above) - edit.sharpening * edit.sharpening * square /
                                              std::max<double>(1, double(fine.pixels.size()));
  edit.grain = std::sqrt(std::max(0.0, rest));
  if (edit.IsLocal()) {
    const Image whole = Residual(photo, edited, vignette);
    edit.of_photo = kMapLeaves * Variation(LowPass(whole)) <= Variation(low);
    if (edit.of_photo) {
      edit.table = TabulateColors(2, [](const Vec3d& c) { return c; });
      mapped = photo;
    }
    edit.layer = LayerOf(photo, edit.of_photo ? whole : residual, DetailLayer(mapped),
                         std::max(0.0, edit.sharpening));
  } else {
    edit.layer = low;
  }
  edit.picture = mapped;
  for (size_t i = 0; i < mapped.pixels.size(); ++i)
    edit.picture.pixels[i] = std::clamp(mapped.pixels[i] + edit.layer.pixels[i], 0.0f, 1.0f);
  return edit;
}

std::vector<std::string> EditNotices(const PhotoEdit& edit, bool keep_vignette) {
  constexpr double kLeastSharpening = 0.1, kLeastGrain = 1.5 / 255;
  std::vector<std::string> notices;
  if (edit.vignette(1) != 1)
    notices.push_back(Format(
        "a vignette (%+.0f %% at the corners) belongs to the picture, not to the scene: %s",
        100 * (edit.vignette(1) - 1),
        keep_vignette ? "films and stills have it" : "it is left out"));
  else if (keep_vignette)
    notices.push_back("the edit has no vignette that could be kept");
  if (edit.sharpening >= kLeastSharpening)
    notices.push_back(
        Format("sharpening (%+.0f %% of fine detail) is left out", 100 * edit.sharpening));
  if (edit.grain >= kLeastGrain)
    notices.push_back(
        Format("grain or fine changes (%.1f of 255) are left out", 255 * edit.grain));
  notices.push_back(
      edit.IsLocal()
          ? Format(
                "the edit depends on the place (%.1f of 255 beyond its map of colours): what "
                "this photo sees follows it, what it does not see follows its neighbours of "
                "like colour%s",
                255 * edit.local, edit.of_photo ? "" : ", after the edit's map of colours")
          : Format("the edit is one map of colours to %.1f of 255, applied to all photos; it "
                   "magnifies differences at most %.2f times",
                   255 * edit.local, SteepestSlope(edit.table)));
  return notices;
}

Image EditAtPhotoSize(const Image& edited, const Image& photo, const std::string& where) {
  constexpr double kLargestShift = 1.5;  // pixels
  const double stretch = (static_cast<double>(edited.width) * photo.height) /
                         (static_cast<double>(edited.height) * photo.width);
  if (std::abs(stretch - 1) > 0.01)
    throw InputError(
        Concat("is ", edited.width, "x", edited.height,
               " pixels, the photo has another shape, as ", photo.width, "x", photo.height),
        where, "undo crop and turn, and export the whole frame again");
  const Image same =
      edited.SameSize(photo) ? edited : Resize(edited, photo.width, photo.height);
  const EdgeShift shift = MeasureEdgeShift(photo, same);
  if (shift.parts > 0 && shift.agreement < 0.05)
    throw InputError("does not show what the photo shows", where,
                     "give the photo that was edited with --photo");
  if (shift.pixels > kLargestShift)
    throw InputError(
        Format("its edges are up to %.1f pixels from the photo's, near (%.0f, %.0f) "
               "of %d x %d",
               shift.pixels, shift.x, shift.y, photo.width, photo.height),
        where,
        "undo crop, turn, lens correction and moved parts, and export the whole "
        "frame again");
  return same;
}

}  // namespace regrade
