// The stage "render" by parts: each process renders some units of the frames to
// styles/NAME/parts/HASH/UNIT/, HASH being that of the stage's inputs, and one joins them.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "pipeline/stages/frame_units.h"
#include "pipeline/stages/scene_frames.h"
#include "pipeline/stages/seen_by_few_recorder.h"
#include "pipeline/workspace/stage_runner.h"

namespace regrade {

// Calls `render` for each unit, once `frames` shows the field or, where that does not fit into
// memory, the part of it that the unit sees. `geometry`: of ReadFieldGeometry.
void RenderUnits(const std::vector<FrameUnit>& units, StoredField geometry,
                 const RunContext& context, SceneFrames* frames,
                 const std::function<void(const FrameUnit&)>& render);

// Renders the unit's frames to `writer`. `tick(set)` is called before each, and `sample` with
// each that SeenByFewRecorder looks at.
void RenderUnit(const FrameUnit& unit, const SeenByFewRecorder& seen,
                const std::function<void(const FrameSet&)>& tick,
                const std::function<void(SampledView)>& sample, SceneFrames* frames,
                FrameWriter* writer);

// Of the stage `render`, the units of context->parts.part that are not there yet, each durable
// once it is done: parts can be rendered at the same time, killed and begun again. In a dry run
// says which. Throws what rendering throws, and Error(kExternalProgram) where films cannot be
// written.
void RenderPart(const Stage& stage, RunContext* context);

// What joining knows of how units were rendered.
struct JoinedParts {
  std::string device;              // of each kind, with commas between
  double seconds = 0;              // of rendering both fields
  std::vector<std::string> films;  // names of those that were made
};

// Throws Error(kInput), which names the units of the stage that nobody rendered.
void RequireParts(const Stage& stage, const RunContext& context);

// Makes frames/ and the films of the style's folder from the parts of `plan`. They stay:
// DropParts removes those of these inputs once all is done. Throws Error(kInput) for parts that
// lack something.
JoinedParts JoinParts(const JsonValue& inputs, const FramePlan& plan, RunContext* context,
                      SeenByFewRecorder* seen);
void DropParts(const JsonValue& inputs, const RunContext& context);

// Says so where there are parts of other settings.
void WarnOfOtherParts(const JsonValue& inputs, const RunContext& context);

}  // namespace regrade
