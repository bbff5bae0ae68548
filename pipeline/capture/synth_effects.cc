#include "pipeline/capture/synth_effects.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string_view>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/base/random_streams.h"
#include "kernels/scene/srgb.h"

namespace regrade {

namespace {

struct NamedEffect {
  std::string_view name;
  bool SynthEffects::*member;
};
constexpr NamedEffect kEffects[] = {{"exposure", &SynthEffects::exposure},
                                    {"noise", &SynthEffects::noise},
                                    {"distortion", &SynthEffects::distortion},
                                    {"barrel", &SynthEffects::barrel},
                                    {"fisheye", &SynthEffects::fisheye},
                                    {"highlights", &SynthEffects::highlights},
                                    {"masks", &SynthEffects::masks},
                                    {"poses", &SynthEffects::poses},
                                    {"mixed-cameras", &SynthEffects::mixed_cameras}};

}  // namespace

SynthEffects ParseSynthEffects(const std::string& list) {
  constexpr char kHint[] =
      "the effects are exposure, noise, highlights, masks, poses, mixed-cameras, and one lens "
      "of distortion, barrel, fisheye";
  SynthEffects effects;
  size_t begin = 0;
  while (begin < list.size()) {
    const size_t end = std::min(list.find(',', begin), list.size());
    const std::string name = list.substr(begin, end - begin);
    begin = end + 1;
    const auto known = std::ranges::find(kEffects, name, &NamedEffect::name);
    if (known != std::end(kEffects))
      effects.*known->member = true;
    else if (name == "motion-blur" || name == "occluders")
      throw UsageError("the effect \"" + name + "\" is not supported", "--effects", kHint);
    else
      throw UsageError("there is no effect \"" + name + "\"", "--effects", kHint);
  }
  if (effects.distortion + effects.barrel + effects.fisheye > 1)
    throw UsageError("only one lens is possible", "--effects", kHint);
  return effects;
}

double SynthGain(uint64_t seed, int index, int views) {
  const double phase = RandomDouble(seed, kStreamSynthGainPhase, 0);
  const double swing = std::sin(2 * M_PI * (phase + 1.5 * index / views));
  const double jump =
      2 * RandomDouble(seed, kStreamSynthGainJump, static_cast<uint64_t>(index)) - 1;
  return 1 + kSynthGainRange * (0.75 * swing + 0.25 * jump);
}

MaskFault SynthMaskFault(int index) {
  constexpr MaskFault kFaults[] = {MaskFault::kNone,  MaskFault::kNone, MaskFault::kShifted,
                                   MaskFault::kEmpty, MaskFault::kNone, MaskFault::kEnlarged};
  return kFaults[index % 6];
}

Image FaultyMask(const Image& mask, MaskFault fault) {
  if (fault == MaskFault::kNone) return mask;
  Image faulty(mask.width, mask.height, 1);
  if (fault == MaskFault::kEmpty) return faulty;
  const int step = mask.width / 5;
  for (int y = 0; y < mask.height; ++y)
    for (int x = 0; x < mask.width; ++x) {
      const float here = *mask.at(x, y), beside = x >= step ? *mask.at(x - step, y) : 0;
      *faulty.at(x, y) = fault == MaskFault::kShifted ? beside : std::max(here, beside);
    }
  return faulty;
}

void ApplyGain(double gain, Image* color) {
  for (float& value : color->pixels)
    value = static_cast<float>(SrgbFromLinear(std::min(1.0, gain * LinearFromSrgb(value))));
}

void ApplyNoise(uint64_t seed, uint64_t stream, double sigma, Image* color) {
  for (size_t i = 0; i < color->pixels.size(); ++i) {
    // Box and Muller 1958; 1 - u is in (0, 1].
    const double radius =
        std::sqrt(-2 * std::log(1 - RandomDouble(seed ^ kRandomSynthNoise, stream, 2 * i)));
    const double angle = 2 * M_PI * RandomDouble(seed ^ kRandomSynthNoise, stream, 2 * i + 1);
    color->pixels[i] = static_cast<float>(
        std::clamp(color->pixels[i] + sigma * radius * std::cos(angle), 0.0, 1.0));
  }
}

Camera WithSynthBody(const SynthEffects& effects, int index, const Camera& camera) {
  if (!effects.mixed_cameras) return camera;
  Camera body = camera;
  if (index % 4 == 1) {
    std::swap(body.width, body.height);
    std::swap(body.fx, body.fy);
    std::swap(body.cx, body.cy);
  }
  if (index % 4 == 2) {
    body = camera.Resized(static_cast<int>(std::lround(kSynthSecondSize * camera.width)),
                          static_cast<int>(std::lround(kSynthSecondSize * camera.height)));
    body.fx *= kSynthSecondFocal;
    body.fy *= kSynthSecondFocal;
  }
  return body;
}

Camera WithSynthLens(const SynthEffects& effects, Camera camera) {
  if (effects.fisheye) camera.lens = LensModel::kFisheye;  // k1 to k4 are 0: equidistant
  if (effects.distortion || effects.barrel) camera.lens = LensModel::kOpenCv;
  if (effects.distortion) camera.distortion = {kSynthK1, kSynthK2};
  if (effects.barrel) camera.distortion = {kSynthBarrelK1};
  return camera;
}

}  // namespace regrade
