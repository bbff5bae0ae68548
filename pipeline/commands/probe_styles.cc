#include "pipeline/commands/probe_styles.h"

#include "pipeline/commands/command.h"
#include "pipeline/images/image_file.h"
#include "pipeline/stages/make_stylizer.h"

namespace regrade {

void ProbeStyles(RunSettings* settings) {
  RequireValue(settings->style.picture(), "--style", "name the style picture");
  for (std::string& picture : settings->style.pictures) {
    RequireValue(picture, "--style", "name the style picture");
    picture = AbsolutePath(picture);
    ReadStylePicture(picture, nullptr);
  }
  ProbeMethod(&settings->style_2d);
  ProbeMasks(&settings->object);
}

}  // namespace regrade
