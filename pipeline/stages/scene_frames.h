// The frames of a run: where they are, and each one as it is before and after styling, and as
// the 2D method makes it of the former.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "kernels/render/field_renderer.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/run/run_context.h"
#include "pipeline/stages/carried_edit.h"
#include "pipeline/stages/film_frames.h"
#include "pipeline/stages/frame_writer.h"
#include "pipeline/stages/make_stylizer.h"
#include "pipeline/stages/object_edit.h"

namespace regrade {

// Where the frames of a run are, in the frame of its field.
struct FramePlan {
  WorkingViews views;
  FilmPath path;
  std::vector<FrameSet> sets;
  double near = 0;  // of SeenByFew

  const FrameSet* film() const;    // the set that the film shows; null where there is none
  const FrameSet* common() const;  // of one camera; null where photos do not differ
  bool film_of_views() const { return film() == nullptr || film()->of_photos; }
  int frames() const;
  int film_frames() const;
};

FramePlan PlanFrames(const RunContext& context, const StoredField& before);

// The sets before there is a field: poses in the capture's world, final sizes.
std::vector<FrameSet> PlannedSets(const RunContext& context);

class SceneFrames {
 public:
  // Keeps references to `context` and `plan`.
  SceneFrames(RunContext* context, const FramePlan& plan);

  // The scene's field, or the part of it that the next frames see, see SeenPart.
  void Show(StoredField before);

  Frame Render(const FrameSet& set, int index);

  // What the first field must show besides the frames: photos with layers say where their edits
  // are, see CarriedEdit.
  std::vector<Camera> CamerasOfEdits() const;

  double seconds() const { return seconds_; }  // of rendering both fields
  std::string device() const;

 private:
  void AddViews2d(const Camera& camera, int index, Frame* frame);

  RunContext* context_;
  const FramePlan& plan_;
  const Backend backend_;
  std::optional<FieldRenderer> source_, styled_;
  std::unique_ptr<ObjectMasks> masks_;
  std::unique_ptr<CoverageRenderer> object_;  // null where the whole scene is styled
  std::vector<Image> coverage_;               // of the current frame
  std::unique_ptr<ViewStylizer> stylizer_;
  std::optional<CarriedEdit> edit_;  // what single photos have beyond the 2D method
  double seconds_ = 0;
};

}  // namespace regrade
