// Effects of a synthetic photo between the scene and the file, with exact parameters.
#pragma once

#include <cstdint>
#include <string>

#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"

namespace regrade {

struct SynthEffects {
  bool exposure = false;       // a gain per photo that drifts within +-30 %
  bool noise = false;          // of the sensor
  bool distortion = false;     // of the lens: mild barrel
  bool barrel = false;         // strong barrel distortion
  bool fisheye = false;        // an equidistant lens
  bool highlights = false;     // of the sun on glazed objects
  bool masks = false;          // of one object, some of them wrong
  bool poses = false;          // given with tracks and with errors
  bool mixed_cameras = false;  // three sizes, portrait and landscape, from two cameras
};

inline constexpr double kSynthNoiseSigma = 2.0 / 255;  // of encoded values
inline constexpr double kSynthK1 = -0.1, kSynthK2 = 0.02;
inline constexpr double kSynthBarrelK1 = -0.2;
inline constexpr double kSynthGainRange = 0.3;
inline constexpr double kSynthPoseTurn = 0.3;    // degrees, about a random axis for each camera
inline constexpr double kSynthPoseStep = 0.005;  // of the largest distance between cameras
inline constexpr double kSynthTrackSigma = 0.5;  // pixels, in each coordinate

// Parses "exposure,noise"; spaces are not allowed, empty means none. Throws Error(kUsage) for
// an unknown or unsupported name, listing the known ones, and for two lenses.
SynthEffects ParseSynthEffects(const std::string& list);

// Gain of linear light for photo `index` of `views`: a slow oscillation plus a small random
// change per photo, within 1 +- kSynthGainRange.
double SynthGain(uint64_t seed, int index, int views);

// Multiplies the linear values by `gain`, clipped to [0, 1].
void ApplyGain(double gain, Image* color);

// Adds Gaussian noise to the encoded values, clipped to [0, 1]; `stream` is the photo's index.
void ApplyNoise(uint64_t seed, uint64_t stream, double sigma, Image* color);

// The simulated fault of the mask of photo `index`: of every six masks the third is shifted by
// a fifth of the width, the fourth is empty, the sixth also covers a region beside the object.
enum class MaskFault { kNone, kShifted, kEmpty, kEnlarged };
MaskFault SynthMaskFault(int index);
Image FaultyMask(const Image& mask, MaskFault fault);

// The camera of photo `index` with mixed cameras: of every four photos the second is in
// portrait orientation (height and width exchanged), and the third has a camera of
// kSynthSecondSize the size and kSynthSecondFocal times the focal length relative to its width.
// Otherwise `camera`.
inline constexpr double kSynthSecondSize = 0.75, kSynthSecondFocal = 1.2;
Camera WithSynthBody(const SynthEffects& effects, int index, const Camera& camera);

// `camera` with the simulated lens, if any.
Camera WithSynthLens(const SynthEffects& effects, Camera camera);

}  // namespace regrade
