// The controls of a run's table that are fields: one fitted to the 2D method's pictures of the
// photos, as the scene's own is to the photos, and the closest that the scene's own colours
// come to these pictures, which bounds the table from above.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "evaluate/frame_source.h"
#include "kernels/base/progress.h"
#include "kernels/scene/camera.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/run/run_context.h"

namespace regrade {

inline constexpr char kFieldControl[] = "control_field_2d";  // the row's name
inline constexpr char kFieldControlFile[] = "field_2d.npz";  // in the style's folder

// Fits it with the options of the scene's own fit, or reads it where it has been fitted to the
// same pictures before. `scene` is the scene's field, `views` are in its frame, `picture(i)` is
// what the 2D method made of view i, one of `indices`.
StoredField ControlField(RunContext* context, const WorkingViews& views,
                         const StoredField& scene, const std::vector<int>& indices,
                         const std::function<Image(int)>& picture,
                         const ProgressFunction& progress);

// Its frames at the cameras with these gains, and with 8 bits as frames on disk have.
NamedFrameSource ControlFieldFrames(const StoredField& stored,
                                    const std::vector<Camera>& cameras, const PhotoGains& gains,
                                    const std::string& name = kFieldControl);

inline constexpr char kCeilingControl[] = "control_ceiling";  // the row's name

// `styled` with its coefficients moved by least squares to `pictures`, one for each camera, of
// its size and of the capture's mean exposure; NaN is left out. See EQ(coefficient-fit): 30
// steps, at most 600000 rays of all views.
StoredField CeilingField(StoredField styled, const std::vector<Camera>& cameras,
                         const FrameSource& pictures, uint64_t seed,
                         const ProgressFunction& progress);

}  // namespace regrade
