#include "pipeline/stages/frame_writer.h"

#include <string>

#include "pipeline/files/json_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {

void WriteFrameNames(const WorkingViews& views, const Workspace& workspace) {
  JsonValue names = JsonValue::Object();
  for (int i = 0; i < views.count(); ++i) names[FrameName(i)] = views.View(i).file;
  WriteJsonFile(workspace.NewPath("frames/names.json"), names);
}

void FrameWriter::Write(const std::shared_ptr<const Frame>& frame, const FrameSet& set,
                        int index) {
  if (set.of_film)
    film_.Do([=, this] { films_->Add(index, frame->source, Shown(frame->styled)); });
  if (set.of_2d_film && frame->views_2d)
    film_.Do([=, this] { films_->AddViews2d(Shown(*frame->views_2d)); });
  if (set.prefix == kFilmPrefix) return;
  const std::string prefix = set.prefix;
  const auto write = [this, prefix, index](const char* sequence, const Image& image) {
    const std::string folder = folder_ + "/frames/" + prefix + sequence;
    MakeFolder(folder);
    WritePng8(folder + "/" + FrameName(index), image);
  };
  source_.Do([=] { write("source", frame->source); });
  styled_.Do([=] { write("styled", frame->styled); });
  if (frame->views_2d) views_2d_.Do([=] { write("views_2d", *frame->views_2d); });
  grey_.Do([=] {
    // Fidelity, which is not measured on the common camera's frames, ignores pixels of high
    // transmittance, and those that an edit says nothing about.
    if (prefix == kCommonPrefix) return;
    write("transmittance", frame->transmittance);
    if (!frame->edited.empty()) write(kEditedFrames, frame->edited);
  });
}

void FrameWriter::Finish() {
  for (OrderedWorker* worker : {&source_, &styled_, &views_2d_, &grey_, &film_})
    worker->Finish();
}

}  // namespace regrade
