// Pictures with colour profiles, made by tests with Little CMS, OpenImageIO and libheif.
#pragma once

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>
#include <lcms2.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <vector>

#include "kernels/scene/image.h"
#include "kernels/scene/srgb.h"

namespace regrade::testing {

// x, y of red, green, blue; white is D65.
using Primaries = std::array<double, 6>;
inline constexpr Primaries kSrgbPrimaries = {0.64, 0.33, 0.30, 0.60, 0.15, 0.06};
inline constexpr Primaries kP3Primaries = {0.680, 0.320, 0.265, 0.690, 0.150, 0.060};
inline constexpr Primaries kAdobePrimaries = {0.64, 0.33, 0.21, 0.71, 0.15, 0.06};

// With sRGB's curve (gamma 0) or a power.
inline std::string IccProfile(const Primaries& p, double gamma, const char* name) {
  const cmsCIExyY white = {0.3127, 0.3290, 1};
  const cmsCIExyYTRIPLE primaries = {{p[0], p[1], 1}, {p[2], p[3], 1}, {p[4], p[5], 1}};
  const double srgb[5] = {2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045};
  cmsToneCurve* curve =
      gamma > 0 ? cmsBuildGamma(nullptr, gamma) : cmsBuildParametricToneCurve(nullptr, 4, srgb);
  cmsToneCurve* const curves[] = {curve, curve, curve};
  cmsHPROFILE profile = cmsCreateRGBProfile(&white, &primaries, curves);
  cmsMLU* text = cmsMLUalloc(nullptr, 1);
  cmsMLUsetASCII(text, "en", "US", name);
  cmsWriteTag(profile, cmsSigProfileDescriptionTag, text);
  cmsUInt32Number size = 0;
  cmsSaveProfileToMem(profile, nullptr, &size);
  std::string bytes(size, '\0');
  cmsSaveProfileToMem(profile, bytes.data(), &size);
  cmsMLUfree(text);
  cmsCloseProfile(profile);
  cmsFreeToneCurve(curve);
  return bytes;
}

// The matrix from linear sRGB to linear light of other primaries with the same white, from its
// definition: independent of Little CMS.
using Matrix = std::array<std::array<double, 3>, 3>;
inline Matrix Inverse(const Matrix& m) {
  Matrix inverse;
  const auto at = [&](int r, int c) { return m[(r + 3) % 3][(c + 3) % 3]; };
  double determinant = 0;
  for (int c = 0; c < 3; ++c)
    determinant += at(0, c) * (at(1, c + 1) * at(2, c + 2) - at(1, c + 2) * at(2, c + 1));
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c)
      inverse[c][r] =
          (at(r + 1, c + 1) * at(r + 2, c + 2) - at(r + 1, c + 2) * at(r + 2, c + 1)) /
          determinant;
  return inverse;
}
inline Matrix XyzFromRgb(const Primaries& p) {
  Matrix columns;
  for (int c = 0; c < 3; ++c) {
    columns[0][c] = p[2 * c] / p[2 * c + 1];
    columns[1][c] = 1;
    columns[2][c] = (1 - p[2 * c] - p[2 * c + 1]) / p[2 * c + 1];
  }
  const double white[3] = {0.3127 / 0.3290, 1, (1 - 0.3127 - 0.3290) / 0.3290};
  const Matrix inverse = Inverse(columns);
  for (int c = 0; c < 3; ++c) {
    double scale = 0;
    for (int k = 0; k < 3; ++k) scale += inverse[c][k] * white[k];
    for (int r = 0; r < 3; ++r) columns[r][c] *= scale;
  }
  return columns;
}
inline Image LinearIn(const Primaries& to, const Image& srgb) {
  const Matrix from_srgb = XyzFromRgb(kSrgbPrimaries), into = Inverse(XyzFromRgb(to));
  Image result = srgb;
  for (int64_t i = 0; i < srgb.num_pixels(); ++i) {
    double xyz[3] = {0, 0, 0};
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c)
        xyz[r] += from_srgb[r][c] * LinearFromSrgb(srgb.pixels[3 * i + c]);
    for (int r = 0; r < 3; ++r) {
      double v = 0;
      for (int c = 0; c < 3; ++c) v += into[r][c] * xyz[c];
      result.pixels[3 * i + r] = static_cast<float>(v);
    }
  }
  return result;
}
// The same colours, encoded for the profile IccProfile(to, gamma).
inline Image EncodedIn(const Primaries& to, double gamma, const Image& srgb) {
  Image result = LinearIn(to, srgb);
  for (float& v : result.pixels)
    v = static_cast<float>(gamma > 0 ? std::pow(std::max(v, 0.f), 1 / gamma)
                                     : SrgbFromLinear(v));
  return result;
}

// By the extension of `path`: 8 or 16 bits, half or float; an empty profile is none.
inline void WriteWithProfile(const std::string& path, const Image& image,
                             const std::string& icc, OIIO::TypeDesc type) {
  OIIO::ImageSpec spec(image.width, image.height, image.channels, type);
  if (!icc.empty())
    spec.attribute("ICCProfile",
                   OIIO::TypeDesc(OIIO::TypeDesc::UINT8, static_cast<int>(icc.size())),
                   icc.data());
  spec["Compression"] = path.ends_with("jpg") ? "jpeg:100" : "none";
  const auto output = OIIO::ImageOutput::create(path);
  ASSERT_TRUE(output && output->open(path, spec)) << OIIO::geterror();
  ASSERT_TRUE(output->write_image(OIIO::TypeDesc::FLOAT, image.pixels.data()));
  ASSERT_TRUE(output->close());
}

}  // namespace regrade::testing
