// regrade page: the scene and its styles as one page that a browser opens without a server.
#include <filesystem>
#include <optional>

#include "kernels/base/error.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/commands/command.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/page/check_page.h"
#include "pipeline/page/field_codec.h"

namespace regrade {
namespace {

struct PageOptions {
  std::string out;
  bool check = false;
  double step = 0.03;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("out", out, {.help = "the page to write, such as scene.html"});
    bind("check", check,
         {.help = "prints how far renders of the page's field are from the exact ones"});
    bind("page-step", step,
         {.help = "step of rounded colour coefficients: bytes grow and errors fall with a "
                  "smaller one",
          .min = 1e-4,
          .max = 1});
  }
};

}  // namespace

void RunPage(const Command& command, const Arguments& arguments, Console* console) {
  PageOptions settings;
  ProgramOptions program;
  OptionSet options;
  options.Add("Page", &settings);
  options.Add("Program", &program);
  constexpr size_t kMostStyles = 16;
  const auto prepared = Prepare(command, arguments, {.most_words = 1 + kMostStyles}, &options);
  if (!prepared) return;
  const std::string& folder = prepared->words[0];
  const StoredField stored = ReadFieldFile(folder + "/field.npz");
  const PageField page = EncodeField(stored.field, settings.step);
  constexpr int kChecked = 320;  // pixels of the longer side
  const WorkingViews views = ReadWorkingViews(folder + "/poses", kChecked, 0)
                                 .InField(stored.field_from_world, stored.ndc);
  const int64_t voxels = stored.field.geometry->num_voxels();
  for (const PageSection& s : page.sections)
    console->Info(Concat(
        "  ", s.name, " ",
        Format("%.3f", static_cast<double>(s.packed.size()) / static_cast<double>(voxels))));
  if (settings.check) {
    const PageCheck check =
        CheckPage(stored.field, DecodeField(page), CheckedViews(views.Cameras(), kChecked));
    console->Info(
        Format("page against exact field, worst of %d views: %.1f dB (mean %.1f); %lld voxels, "
               "%.2f bytes a voxel in the page",
               check.views, check.worst_db, check.mean_db, static_cast<long long>(voxels),
               static_cast<double>(page.bytes()) * 4 / 3 / static_cast<double>(voxels)));
  }
}

}  // namespace regrade
