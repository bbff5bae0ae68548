// The 2D method of a run, made once from the style picture and, where it asks for it, from the
// colours of all photos.
#pragma once

#include <memory>

#include "pipeline/stages/run_context.h"
#include "stylize/view_stylizer.h"

namespace regrade {

std::unique_ptr<ViewStylizer> MakeSceneStylizer(RunContext* context, const Capture& capture);

}  // namespace regrade
