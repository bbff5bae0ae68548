#include "pipeline/stages/photo_edit.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"
#include "pipeline/images/edge_shift.h"
#include "stylize/fit_color_table.h"
#include "stylize/image/view_stylizer.h"

namespace regrade {
namespace {

constexpr int kTable = 33, kDraftTable = 17;
constexpr double kTableSmoothness = 0.1;
constexpr int kTurns = 6;   // of fitting the map and the vignette
constexpr int kRings = 32;  // of equal width, from the centre to a corner
constexpr double kLeastVignette = 0.03;
constexpr double kVignetteExplains = 0.5;
constexpr double kLocalStep = 2.0 / 255, kLocalShare = 0.2;

Vec3d ColorAt(const Image& image, int64_t i) {
  const float* p = &image.pixels[static_cast<size_t>(3 * i)];
  return {p[0], p[1], p[2]};
}

// 1 + a r^2 + b r^4, r in half diagonals from the centre.
struct Vignette {
  double a = 0, b = 0;
  double operator()(double squared) const { return 1 + a * squared + b * squared * squared; }
};

double SquaredRadius(const Image& image, int64_t i) {
  const double x = static_cast<double>(i % image.width) + 0.5 - 0.5 * image.width;
  const double y = static_cast<double>(i / image.width) + 0.5 - 0.5 * image.height;
  return (x * x + y * y) * 4 /
         (static_cast<double>(image.width) * image.width +
          static_cast<double>(image.height) * image.height);
}

ColorTable FitTable(const Image& photo, const Image& edited, const Vignette& vignette, int size,
                    int64_t stride) {
  TableFit fit(size);
  for (int64_t i = 0; i < photo.num_pixels(); i += stride)
    fit.Add(ColorAt(photo, i), ColorAt(edited, i) * (1 / vignette(SquaredRadius(photo, i))));
  return fit.Solve(kTableSmoothness);
}

// Factor of each ring by which the mapped photo is brighter or darker than the edit.
struct Rings {
  double product[kRings] = {}, square[kRings] = {};
  double Factor(int k) const { return square[k] > 0 ? product[k] / square[k] : 1; }
};

Rings MeasureRings(const Image& mapped, const Image& edited) {
  Rings rings;
  for (int64_t i = 0; i < mapped.num_pixels(); ++i) {
    const double r = std::sqrt(SquaredRadius(mapped, i));
    const int k = std::min(kRings - 1, static_cast<int>(r * kRings));
    const Vec3d m = ColorAt(mapped, i), e = ColorAt(edited, i);
    rings.product[k] += Dot(m, e);
    rings.square[k] += Dot(m, m);
  }
  return rings;
}

// Least squares over the rings, weighted by their light.
Vignette FitVignette(const Rings& rings) {
  // Factors are c (1 + a r^2 + b r^4): linear in c, c a and c b.
  double gram[3][3] = {}, right[3] = {};
  for (int k = 0; k < kRings; ++k) {
    const double r = (k + 0.5) / kRings, s = r * r;
    const double x[3] = {1, s, s * s};
    for (int i = 0; i < 3; ++i) {
      right[i] += rings.square[k] * x[i] * rings.Factor(k);
      for (int j = 0; j < 3; ++j) gram[i][j] += rings.square[k] * x[i] * x[j];
    }
  }
  Mat3d m;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m(i, j) = gram[i][j];
  const double determinant = m.Determinant();
  if (!(std::abs(determinant) > 1e-12 * std::pow(gram[0][0], 3))) return {};
  Vec3d solution;
  for (int c = 0; c < 3; ++c) {
    Mat3d replaced = m;
    for (int i = 0; i < 3; ++i) replaced(i, c) = right[i];
    solution[c] = replaced.Determinant() / determinant;
  }
  if (!(solution.x > 0.2)) return {};
  const Vignette vignette{solution.y / solution.x, solution.z / solution.x};
  for (double s = 0; s <= 1; s += 0.05)
    if (!(vignette(s) > 0.05)) return {};
  return vignette;
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
Image FineDetail(const Image& image) {
  const Image half = Resize(image, std::max(1, image.width / 2), std::max(1, image.height / 2));
  return Minus(image, Resize(half, image.width, image.height));
}

bool IsVignette(const Rings& rings, const Vignette& vignette, double left,
                double left_without) {
  const double centre = rings.Factor(1), half = rings.Factor(kRings / 2),
               corner = rings.Factor(kRings - 3);
  return std::abs(vignette(1) - 1) >= kLeastVignette &&
         left < kVignetteExplains * left_without &&
         std::abs(corner - half) > std::abs(half - centre);
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
  edit.vignette = vignette(1);

  edit.table = FitTable(photo, edited, vignette, kTable, std::max<int64_t>(1, stride / 6));
  mapped = Mapped(photo, edit.table);
  const Image residual = Residual(mapped, edited, vignette), low = LowPass(residual);
  edit.local = std::sqrt(MeanSquare(low));
  const Image fine = FineDetail(mapped), above = FineDetail(Minus(residual, low));
  double product = 0, square = 0;
  for (size_t i = 0; i < fine.pixels.size(); ++i) {
    product += double{fine.pixels[i]} * double{above.pixels[i]};
    square += double{fine.pixels[i]} * double{fine.pixels[i]};
  }
  edit.sharpening = square > 0 ? product / square : 0;
  const double rest = MeanSquare(above) - edit.sharpening * edit.sharpening * square /
                                              std::max<double>(1, double(fine.pixels.size()));
  edit.grain = std::sqrt(std::max(0.0, rest));
  edit.picture = mapped;
  for (size_t i = 0; i < mapped.pixels.size(); ++i)
    edit.picture.pixels[i] = std::clamp(mapped.pixels[i] + low.pixels[i], 0.0f, 1.0f);
  return edit;
}

std::vector<std::string> EditNotices(const PhotoEdit& edit) {
  constexpr double kLeastSharpening = 0.1, kLeastGrain = 1.5 / 255;
  std::vector<std::string> notices;
  if (edit.vignette != 1)
    notices.push_back(Format(
        "a vignette (%+.0f %% at the corners) belongs to the picture, not to the scene: it is "
        "left out",
        100 * (edit.vignette - 1)));
  if (edit.sharpening >= kLeastSharpening)
    notices.push_back(
        Format("sharpening (%+.0f %% of fine detail) is left out", 100 * edit.sharpening));
  if (edit.grain >= kLeastGrain)
    notices.push_back(
        Format("grain or fine changes (%.1f of 255) are left out", 255 * edit.grain));
  notices.push_back(
      edit.IsLocal()
          ? Format(
                "the edit depends on the place (%.1f of 255 beyond its map of colours): it "
                "is learned from this photo alone, and places that colours cannot tell apart "
                "follow roughly",
                255 * edit.local)
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
               " pixels, the photo has another shape: ", photo.width, "x", photo.height),
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
