// What a synthetic photograph may suffer between the scene and the file, each with its exact
// parameters.
#pragma once

#include <cstdint>
#include <string>

#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"

namespace regrade {

struct SynthEffects {
  bool exposure = false;       // a gain per photo that drifts within +-30 %
  bool noise = false;          // of the sensor
  bool distortion = false;     // of the lens: a mild barrel
  bool barrel = false;         // a strong one
  bool fisheye = false;        // a lens that shows angles, not tangents
  bool highlights = false;     // of the sun on glazed things
  bool masks = false;          // of one object, some of them wrong
  bool poses = false;          // handed over with tracks, and a little off
  bool mixed_cameras = false;  // photos of three sizes, upright and across, from two cameras
};

inline constexpr double kSynthNoiseSigma = 2.0 / 255;  // of encoded values
inline constexpr double kSynthK1 = -0.1, kSynthK2 = 0.02;
inline constexpr double kSynthBarrelK1 = -0.2;
inline constexpr double kSynthGainRange = 0.3;
inline constexpr double kSynthPoseTurn = 0.3;    // degrees, about an axis of each camera's own
inline constexpr double kSynthPoseStep = 0.005;  // of the largest distance between cameras
inline constexpr double kSynthTrackSigma = 0.5;  // pixels, each way

// Parses "exposure,noise"; spaces are not allowed, empty means none. Throws Error (kUsage) for
// a name that is unknown, listing the known ones, or not in this version, and for two lenses.
SynthEffects ParseSynthEffects(const std::string& list);

// Gain of linear light for photo `index` of `views`: a slow swing and a small jump from photo
// to photo, within 1 +- kSynthGainRange.
double SynthGain(uint64_t seed, int index, int views);

// The photo in other light: linear values times gain, clipped to [0, 1].
void ApplyGain(double gain, Image* color);

// Adds Gaussian noise to the encoded values, clipped to [0, 1]; `stream` is the photo's index.
void ApplyNoise(uint64_t seed, uint64_t stream, double sigma, Image* color);

// What a hasty person would hand over for the mask of photo `index`: of every six the third is
// a fifth of the width off, the fourth empty, the sixth has swallowed a block beside the
// object.
enum class MaskFault { kNone, kShifted, kEmpty, kSwollen };
MaskFault SynthMaskFault(int index);
Image FaultyMask(const Image& mask, MaskFault fault);

// The camera of photo `index` where cameras are mixed: of every four photos the second is held
// upright (height and width exchanged), the third is by a camera of kSynthSecondSize the size
// and kSynthSecondFocal times the focal length in terms of its width. Otherwise `camera`.
inline constexpr double kSynthSecondSize = 0.75, kSynthSecondFocal = 1.2;
Camera WithSynthBody(const SynthEffects& effects, int index, const Camera& camera);

// The same view through the simulated lens, if there is one.
Camera WithSynthLens(const SynthEffects& effects, Camera camera);

}  // namespace regrade
