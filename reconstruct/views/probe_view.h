// How well a place shows a scene of splats, by a small picture from there.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/render/field_renderer.h"
#include "kernels/scene/camera.h"
#include "kernels/splats/splats.h"

namespace regrade {

struct ViewProbe {
  double opaque = 0;   // fraction of pixels through which next to no light passes
  double empty = 0;    // fraction without splats
  double border = 0;   // the same of the pixels along the picture's edges
  double rough = 0;    // fraction of neighbouring opaque pixels between which depth jumps
  double nearest = 0;  // depth that a fiftieth of the opaque pixels are nearer than; world
  // Of the samples: how well each is seen, in [0, 1]; 0: hidden or outside of the picture.
  std::vector<float> seen;

  // Of what is not empty, the part that is opaque and smooth, in [0, 1]: holes, needles and
  // what no photo has seen make it small.
  double Quality() const;
};

// Splats that stand for all: at most `most` opaque ones.
struct SampledSplat {
  Vec3d mean;
  double size;  // middle one of the standard deviations, world units
};
std::vector<SampledSplat> SampleSplats(const Splats& splats, int64_t most);

// What probes see of `field`, which is made of `splats`: no colours, and of more than `most`
// splats one of each few, which covers as much as they do.
RadianceField FieldForProbes(const Splats& splats, const RadianceField& field, int64_t most);

// A splat is seen best where it is 0.4 to 4 pixels large in a picture of 480 pixels: photos
// show no more from farther away, and had no more to show from nearer.
ViewProbe ProbeView(const FieldRenderer& renderer, const Camera& camera,
                    const std::vector<SampledSplat>& samples);

}  // namespace regrade
