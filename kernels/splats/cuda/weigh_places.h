// The weights with which places of pictures see splats, see EQ(splat-composite), on the device:
// a thread follows a place through the list of its tile.
#pragma once

#include "kernels/device/device_memory.h"
#include "kernels/scene/view_rays.h"
#include "kernels/splats/splat_camera.h"
#include "kernels/splats/splats.h"

namespace regrade {

struct SplatSample {
  int32_t splat;
  Vec3f direction;  // from the camera to the splat, of length 1
  float weight;     // w_i
  int32_t ray;      // within its group
};

// The splats that the tiles of a camera's picture show, front to back; device pointers.
struct CameraLists {
  SplatCamera camera;
  int columns = 0;                 // of tiles
  const int32_t* first = nullptr;  // [tiles]: in `splat`; null: the lists are not there
  const int32_t* end = nullptr;    // [tiles]
  const int32_t* splat = nullptr;
};

// Device pointers.
struct PlaceGroups {
  const ViewPlace* place;  // [groups, rays]; a camera below 0: no ray, which sees nothing
  int64_t groups, rays;
};

// Samples of a group lie in no fixed order, but those of a ray front to back. Device pointers.
struct SplatSamplesView {
  SplatSample* sample;   // [groups, capacity]
  int64_t capacity;      // samples beyond it are counted and not written
  int32_t* count;        // [groups]; is added to
  float* transmittance;  // [groups, rays]
};

// Weighs the places of camera `only`, or with -1 of all whose lists are there; `lists`, on the
// device, has a row for each camera. Samples that weigh at most min_weight are dropped. Arrays
// of `splats` are aligned to 16 bytes.
void WeighPlaces(const SplatsView<float>& splats, const SplatOptions& options,
                 const CameraLists* lists, int32_t only, const PlaceGroups& places,
                 float min_weight, const SplatSamplesView& samples);

}  // namespace regrade
