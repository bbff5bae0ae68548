// A 2D method that is somebody's program, started once for each view.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "stylize/image/view_stylizer.h"

namespace regrade {

// Words are separated by blanks; "..." and '...' keep blanks together, and no other character
// means anything: there is no shell, no variable and no escape. Error(kUsage) for a quote that
// stays open.
std::vector<std::string> SplitCommand(const std::string& command);

// In every word {input}, {style} and {output} are replaced by paths of PNG files (the style by
// the style picture's own path); {input} and {output} must occur. What is put in is never split
// or looked at again. The program has `limit_s` seconds for each view. It must end with status
// 0 and leave a picture at {output} with the view's aspect, which is brought to its size.
//
// Error(kUsage) for a command without its placeholders; Stylize throws Error(kExternalProgram)
// with the program's last lines.
std::unique_ptr<ViewStylizer> MakeCommandStylizer(const std::string& command,
                                                  const std::string& style_path,
                                                  double limit_s);

}  // namespace regrade
