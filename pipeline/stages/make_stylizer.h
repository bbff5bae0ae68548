// The 2D method of a run, made once from the style picture and, where it asks for it, from the
// colours of all photos.
#pragma once

#include <memory>
#include <vector>

#include "pipeline/capture/object_masks.h"
#include "pipeline/files/json_file.h"
#include "pipeline/program/known_networks.h"
#include "pipeline/run/run_context.h"
#include "stylize/image/masked_stylizer.h"
#include "stylize/image/view_stylizer.h"

namespace regrade {

// With `masks` it styles their regions. Of splats that came without photos it styles what they
// cover, and methods of colours measure that alone: empty parts of pictures stay as they are.
// `coverage` has the regions of a picture; without it all pictures are of the views.
std::unique_ptr<ViewStylizer> MakeSceneStylizer(RunContext* context, const WorkingViews& views,
                                                const ObjectMasks* masks = nullptr,
                                                const CoverageFunction& coverage = nullptr);

// Looked at before long work starts: the method exists, and so does the folder or file that it
// names, which is made absolute; a command has its placeholders; networks that are had by name
// are fetched as `access` allows, which says nothing in a dry run. Throws Error(kUsage,
// kInput).
void ProbeMethod(StyleOptions* options, const NetworkAccess& access);

// How networks may be fetched: after a yes at the terminal, or with `yes`, which is said.
NetworkAccess AccessAfterYes(bool yes, Console* console);

// Views that the style is learned from and measured on: the fitted ones that have a picture in
// views_2d/; where none of them has, all that do, held out or not. Throws Error(kInput) if
// there is none at all.
std::vector<int> StyledViews(const Workspace& workspace, const WorkingViews& views);

// Hashes of the files that the method itself reads, as part of a stage's inputs: networks, or
// pictures of a folder. Null for other methods. Throws Error(kInput) for a file or folder that
// is not there.
JsonValue MethodFiles(const StyleOptions& options);

}  // namespace regrade
