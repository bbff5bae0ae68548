// Makes the page of an output folder: reads the scene and its styles, and renders the pictures
// that a page begins with.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/field/radiance_field.h"
#include "pipeline/page/field_codec.h"

namespace regrade {

struct PageOptions {
  bool check = false;
  std::string names = "on";
  bool served = false;     // by `regrade view`
  int64_t most_bytes = 0;  // of the page; 0 has no limit

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("check", check,
         {.help = "measures how far renders of the page's field and styles are from the exact "
                  "ones, and prints it"});
    bind("names", names,
         {.help =
              "what the page names: on is styles and photos' files, styles are styles alone, "
              "as in a run's own page, off is nothing, for a page that others get",
          .choices = "on|styles|off"});
  }
};

// What helps where a scene is of voxels.
inline constexpr char kNoPage[] =
    "fit it without --field voxels and --preset paper, or write splats of it with `regrade "
    "export --format glb`";

struct MadePage {
  std::string html;                     // empty where the page would have more than most_bytes
  int64_t bytes = 0;                    // that it would have
  int64_t splats = 0, field_bytes = 0;  // in the text of the page
  std::vector<int64_t> style_bytes;
  std::vector<std::string> report;  // what is left out, at what cost, and the lines of --check
  RadianceField field;              // as the page has it
  PageRecords places;               // its splats, as the page orders them
};

// `styles`: names in `folder`; with what they add splat by splat. Where most_bytes do not hold
// all splats, the page has those that photos show most, see ByWhatIsShown, and the report says
// how far its pictures are from the exact ones. Throws Error(kInput), of a scene of voxels,
// too.
MadePage MakePage(const std::string& folder, const std::vector<std::string>& styles,
                  const PageOptions& options, const ProgressFunction& progress);

}  // namespace regrade
