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
  double step = 0.03;
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

struct MadePage {
  std::string html;                      // empty where the page would have more than most_bytes
  int64_t bytes = 0;                     // that it would have
  int64_t records = 0, field_bytes = 0;  // in the text of the page
  const char* records_name = "";         // see RecordsName
  int64_t coarse_bytes = 0;              // of what is shown first
  std::vector<int64_t> style_bytes;
  std::vector<std::string> report;  // what is left out, at what cost, and the lines of --check
  RadianceField field;              // as the page has it
  PageRecords places;               // its records, as the page orders them
};

// `styles`: names in `folder`; with what they add voxel by voxel. Where most_bytes do not hold
// all splats, the page has those that photos show most, see ByWhatIsShown, and the report says
// how far its pictures are from the exact ones. Throws Error(kInput).
MadePage MakePage(const std::string& folder, const std::vector<std::string>& styles,
                  const PageOptions& options, const ProgressFunction& progress);

}  // namespace regrade
