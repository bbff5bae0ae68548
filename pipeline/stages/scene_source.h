// What a run begins with: photos, or a file of splats, which is read in place of a fit.
#pragma once

#include <optional>
#include <string>

#include "pipeline/run/run_context.h"
#include "pipeline/workspace/stage_runner.h"

namespace regrade {

struct SceneSource {
  // Of the stages that find poses of photos.
  const char* pose_effects;  // behind --effects
  bool has_points;           // they are not found in the photos
  // Seconds to read and measure a field in place of a fit.
  std::optional<double> read_seconds;

  // Makes paths absolute, and checks options that belong to the source. Throws Error(kUsage)
  // and Error(kInput).
  void (*probe)(RunContext* context);
  // The folder or film with photos or cameras; empty where there is none.
  std::string (*capture)(const RunContext& context);
  // Of the pictures that take the place of photos, before they are made; none where there are
  // photos.
  std::optional<CaptureSize> (*size)(const RunContext& context);
  // The stages in place of those that take photos; none for these.
  std::optional<Stage> (*pose)(RunContext* context);
  std::optional<Stage> (*reconstruct)(RunContext* context);
  // Of what is read beside photos; null if nothing is.
  JsonValue (*hash)(const RunContext& context);
  // See AddSplatPoints. Only of a source that has points.
  void (*add_points)(const RunContext& context, const std::string& sparse_folder,
                     const std::string& cameras, Capture* capture);
};

const SceneSource& SourceOf(const RunContext& context);

}  // namespace regrade
