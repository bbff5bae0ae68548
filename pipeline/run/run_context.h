// What every stage gets: the settings, the output folder and the console.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/capture/capture_source.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/program/console.h"
#include "pipeline/run/film_parts.h"
#include "pipeline/run/refine_options.h"
#include "pipeline/run/run_settings.h"
#include "pipeline/run/stage_estimate.h"
#include "pipeline/workspace/stage_runner.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {

// What a dry run says of a stage.
struct PlannedStage {
  std::string style;  // empty for stages of the scene
  std::string stage;
  bool done = false;  // before; else it would be done
  double seconds = 0;
  uint64_t memory = 0;  // bytes; 0 if not planned
};

struct RunContext {
  RunSettings settings;
  OptionSet options;   // bound to `settings`
  std::string source;  // PHOTOS or CAPTURE, absolute; empty where a command takes none
  Workspace* workspace = nullptr;  // of the scene
  Workspace* style = nullptr;      // of the style that is being made: styles/NAME
  Console* console = nullptr;
  std::optional<CaptureSize> source_size = {};  // of the photos, once somebody asked for it
  std::vector<PlannedStage> planned = {};       // in a dry run
  FilmParts parts = {};                         // of `regrade render`
  RefineOptions refine = {};                    // of `regrade refine`
  std::shared_ptr<KeptPhotos> photos = {};      // what several stages read

  // What `source` is, or the capture that gives a file of splats its cameras. Folders of masks
  // in it hold no photos.
  CaptureSource Source() const {
    const std::string& cameras = settings.splat_input.cameras;
    return DetectCapture(cameras.empty() ? source : cameras,
                         {settings.pose.photo_masks, settings.object.masks});
  }
  // Of the finished stage "pose", with the gains of "reconstruct"; cameras in the capture's
  // world.
  WorkingViews Views() const {
    return ReadWorkingViews(workspace->Path("poses"), settings.scene.photo_size,
                            settings.run.holdout)
        .KeepingPhotos(photos)
        .CamerasFor(settings.scene.Kind());
  }
  // Where a stage has its record and its results. A style must be chosen for a stage of one.
  Workspace& FolderOf(const std::string& stage) const {
    return *(IsOfScene(stage) ? workspace : style);
  }
  // Hash of a finished stage's outputs, an input of later stages; null before it is done.
  JsonValue ResultOf(const std::string& stage) const {
    const auto record = FolderOf(stage).Find(stage);
    return record ? JsonValue(record->OutputHash()) : JsonValue();
  }
};

}  // namespace regrade
