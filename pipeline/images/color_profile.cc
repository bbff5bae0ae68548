// Calls Little CMS in floating point, where matrix profiles are not clamped.
#include "pipeline/images/color_profile.h"

#include <lcms2.h>
#include <lcms2_plugin.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/scene/srgb.h"

namespace regrade {
namespace {

// Profiles of cameras and screens have some kilobytes, those of printers a few megabytes.
constexpr size_t kLargestProfile = 32 << 20;
// In values of 8 bits.
constexpr double kSameStep = 0.5;
// White of a picture that is made for HDR (BT.2408), and the peaks that its curves refer to.
constexpr double kWhite = 203, kPqPeak = 10000, kHlgPeak = 1000;  // cd/m^2

// A profile of some bytes may claim tables of any size.
constexpr cmsUInt32Number kLargestTable = 64 << 20;

void* Allocate(cmsContext, cmsUInt32Number size) {
  return size > kLargestTable ? nullptr : std::malloc(size);
}
void* Reallocate(cmsContext, void* block, cmsUInt32Number size) {
  return size > kLargestTable ? nullptr : std::realloc(block, size);
}
void Deallocate(cmsContext, void* block) { std::free(block); }

// With the limit above, and without messages.
cmsContext Context() {
  static const cmsContext context = [] {
    cmsPluginMemHandler memory = {};
    memory.base = {cmsPluginMagicNumber, 2060, cmsPluginMemHandlerSig, nullptr};
    memory.MallocPtr = Allocate;
    memory.FreePtr = Deallocate;
    memory.ReallocPtr = Reallocate;
    return cmsCreateContext(&memory, nullptr);
  }();
  REGRADE_CHECK(context != nullptr);
  return context;
}

struct CloseProfile {
  void operator()(void* profile) const { cmsCloseProfile(profile); }
};
struct DeleteTransform {
  void operator()(void* transform) const { cmsDeleteTransform(transform); }
};
struct FreeCurve {
  void operator()(cmsToneCurve* curve) const { cmsFreeToneCurve(curve); }
};
using Profile = std::unique_ptr<void, CloseProfile>;
using Transform = std::unique_ptr<void, DeleteTransform>;

using Chromaticities = std::array<double, 8>;  // x, y of red, green, blue, white
constexpr Chromaticities kSrgb = {0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290};
constexpr Chromaticities kAdobe = {0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.3290};

Profile RgbProfile(const Chromaticities& c, double gamma) {
  const cmsCIExyY white = {c[6], c[7], 1};
  const cmsCIExyYTRIPLE primaries = {{c[0], c[1], 1}, {c[2], c[3], 1}, {c[4], c[5], 1}};
  const std::unique_ptr<cmsToneCurve, FreeCurve> curve(cmsBuildGamma(Context(), gamma));
  cmsToneCurve* const curves[] = {curve.get(), curve.get(), curve.get()};
  return Profile(cmsCreateRGBProfileTHR(Context(), &white, &primaries, curves));
}

cmsUInt32Number FormatOf(int channels) {
  return channels == 1 ? TYPE_GRAY_FLT : channels == 3 ? TYPE_RGB_FLT : TYPE_RGBA_FLT;
}

// To linear light; null if the profiles do not fit.
Transform ToLinear(const Profile& profile, int channels) {
  const Profile linear = RgbProfile(kSrgb, 1);
  if (profile == nullptr || linear == nullptr) return nullptr;
  return Transform(cmsCreateTransformTHR(
      Context(), profile.get(), FormatOf(channels), linear.get(),
      channels == 4 ? TYPE_RGBA_FLT : TYPE_RGB_FLT, INTENT_RELATIVE_COLORIMETRIC,
      cmsFLAGS_NOCACHE | cmsFLAGS_COPY_ALPHA));
}

// Whether colours of a lattice come out as if the profile were sRGB.
bool IsSrgb(const Transform& transform, int channels) {
  constexpr int kLevels = 9;
  for (int i = 0; i < kLevels * kLevels * kLevels; ++i) {
    const int levels[] = {i % kLevels, i / kLevels % kLevels, i / kLevels / kLevels};
    float in[4] = {0, 0, 0, 1}, out[4] = {0, 0, 0, 1};
    for (int c = 0; c < 3; ++c)
      in[c] = static_cast<float>(levels[channels == 1 ? 0 : c]) / (kLevels - 1);
    cmsDoTransform(transform.get(), in, out, 1);
    for (int c = 0; c < 3; ++c)
      if (!(std::abs(SrgbFromLinear(out[c]) - in[c]) <= kSameStep / 255)) return false;
  }
  return true;
}

void Apply(const Transform& transform, Image* image) {
#pragma omp parallel
  {
    std::vector<float> row(static_cast<size_t>(image->width) * 4);
#pragma omp for schedule(static)
    for (int y = 0; y < image->height; ++y) {
      float* const pixels = image->at(0, y);
      cmsDoTransform(transform.get(), pixels, row.data(), image->width);
      if (image->channels == 1)  // grey stays grey
        for (int x = 0; x < image->width; ++x) pixels[x] = row[3 * x + 1];
      else
        std::copy_n(row.data(), static_cast<size_t>(image->width) * image->channels, pixels);
    }
  }
}

std::string DescriptionOf(const Profile& profile) {
  char text[128] = "";
  cmsGetProfileInfoASCII(profile.get(), cmsInfoDescription, "en", "US", text, sizeof text);
  return text[0] == '\0' ? "a colour profile without a name" : text;
}

// SMPTE ST 2084: linear light, 1 at kWhite.
float LightFromPq(float encoded) {
  constexpr double m1 = 2610 / 16384.0, m2 = 2523 / 4096.0 * 128, c1 = 3424 / 4096.0,
                   c2 = 2413 / 4096.0 * 32, c3 = 2392 / 4096.0 * 32;
  const double power = std::pow(std::clamp(static_cast<double>(encoded), 0.0, 1.0), 1 / m2);
  const double light = std::pow(std::max(power - c1, 0.0) / (c2 - c3 * power), 1 / m1);
  return static_cast<float>(light * kPqPeak / kWhite);
}

// HLG's inverse OETF (BT.2100): light of the scene, 1 at the peak.
float SceneLightFromHlg(float encoded) {
  constexpr double a = 0.17883277, b = 1 - 4 * a, c = 0.55991073;
  const double e = std::clamp(static_cast<double>(encoded), 0.0, 1.0);
  return static_cast<float>(e <= 0.5 ? e * e / 3 : (std::exp((e - c) / a) + b) / 12);
}

// HLG's OOTF for a screen of kHlgPeak: light of the scene, RGB of sRGB's primaries, becomes
// that of the screen, 1 at kWhite. It multiplies each colour by a power of its luminance, which
// is the same in all primaries.
void ShowHlg(Image* image) {
  constexpr double kGamma = 1.2;
  const int colors = std::min(image->channels, 3);
  for (int64_t i = 0; i < image->num_pixels(); ++i) {
    float* const v = &image->pixels[i * image->channels];
    const double luminance = colors == 1 ? v[0] : 0.2126 * v[0] + 0.7152 * v[1] + 0.0722 * v[2];
    const double factor = kHlgPeak / kWhite * std::pow(std::max(luminance, 0.0), kGamma - 1);
    for (int c = 0; c < colors; ++c) v[c] = static_cast<float>(factor * v[c]);
  }
}

enum Transfer { kGamma22 = 4, kGamma28 = 5, kLinearLight = 8, kPq = 16, kHlg = 18 };

float LightFromCicp(int transfer, float encoded) {
  if (transfer == kGamma22) return std::pow(std::max(encoded, 0.f), 2.2f);
  if (transfer == kGamma28) return std::pow(std::max(encoded, 0.f), 2.8f);
  if (transfer == kLinearLight) return encoded;
  if (transfer == kPq) return LightFromPq(encoded);
  if (transfer == kHlg) return SceneLightFromHlg(encoded);
  return static_cast<float>(LinearFromSrgb(encoded));
}

struct NamedPrimaries {
  int code;
  const char* name;
  Chromaticities chromaticities;
};
constexpr NamedPrimaries kPrimaries[] = {
    {9, "BT.2020", {0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290}},
    {11, "DCI-P3", {0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.314, 0.351}},
    {12, "Display P3", {0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290}},
};

const NamedPrimaries* FindPrimaries(int code) {
  const auto* found = std::ranges::find(kPrimaries, code, &NamedPrimaries::code);
  return found == std::end(kPrimaries) ? nullptr : found;
}

bool HasOwnCurve(int transfer) {
  return transfer == kGamma22 || transfer == kGamma28 || transfer == kLinearLight ||
         transfer == kPq || transfer == kHlg;
}

}  // namespace

std::string LinearizeByProfile(std::string_view icc, Image* image, std::string* problem) {
  Profile profile;
  if (icc.size() <= kLargestProfile)
    profile.reset(cmsOpenProfileFromMemTHR(Context(), icc.data(),
                                           static_cast<cmsUInt32Number>(icc.size())));
  if (profile == nullptr) {
    *problem = "a damaged colour profile is not applied: colours are taken as sRGB";
    return "";
  }
  const std::string name = DescriptionOf(profile);
  const cmsColorSpaceSignature wanted = image->channels == 1 ? cmsSigGrayData : cmsSigRgbData;
  Transform transform;
  if (cmsGetColorSpace(profile.get()) == wanted) transform = ToLinear(profile, image->channels);
  if (transform == nullptr) {
    *problem = "the colour profile \"" + name +
               "\" does not fit the picture and is not applied: colours are taken as sRGB";
    return "";
  }
  if (IsSrgb(transform, image->channels)) return "";
  Apply(transform, image);
  return name;
}

std::string LinearizeByPrimaries(const std::array<float, 8>& chromaticities, Image* image) {
  Chromaticities from;
  std::ranges::copy(chromaticities, from.begin());
  double difference = 0;
  for (size_t i = 0; i < from.size(); ++i)
    difference = std::max(difference, std::abs(from[i] - kSrgb[i]));
  // Writers round to three digits.
  if (!(difference > 2e-3) || image->channels == 1) return "";
  const Transform transform = ToLinear(RgbProfile(from, 1), image->channels);
  if (transform == nullptr) return "";
  Apply(transform, image);
  return Format("linear light with red at %.3f, %.3f", from[0], from[1]);
}

bool IsSrgbLike(int primaries, int transfer) {
  return FindPrimaries(primaries) == nullptr && !HasOwnCurve(transfer);
}

std::string CicpName(int primaries, int transfer) {
  const NamedPrimaries* named = FindPrimaries(primaries);
  std::string name = named == nullptr ? "sRGB's primaries" : named->name;
  if (transfer == kHlg) name += ", HLG";
  if (transfer == kPq) name += ", PQ";
  if (transfer == kLinearLight) name += ", linear light";
  return name;
}

std::string LinearizeByCicp(int primaries, int transfer, Image* image) {
  if (IsSrgbLike(primaries, transfer)) return "";
  const int colors = std::min(image->channels, 3);
  for (int64_t i = 0; i < image->num_pixels(); ++i)
    for (int c = 0; c < colors; ++c) {
      float& v = image->pixels[i * image->channels + c];
      v = LightFromCicp(transfer, v);
    }
  const NamedPrimaries* named = FindPrimaries(primaries);
  if (named != nullptr && image->channels != 1)
    Apply(ToLinear(RgbProfile(named->chromaticities, 1), image->channels), image);
  if (transfer == kHlg) ShowHlg(image);
  return CicpName(primaries, transfer);
}

std::string AdobeRgbProfile() {
  const Profile profile = RgbProfile(kAdobe, 563 / 256.0);  // its exact exponent
  REGRADE_CHECK(profile != nullptr);
  cmsUInt32Number size = 0;
  cmsSaveProfileToMem(profile.get(), nullptr, &size);
  std::string bytes(size, '\0');
  cmsSaveProfileToMem(profile.get(), bytes.data(), &size);
  return bytes;
}

}  // namespace regrade
