// regrade contact-sheet: one picture that compares the styles of a folder.
#include <algorithm>
#include <cmath>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/base/options.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/commands/command.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/seen_field.h"
#include "pipeline/files/text.h"
#include "pipeline/images/contact_sheet.h"
#include "pipeline/images/image_file.h"
#include "pipeline/program/run_options.h"
#include "pipeline/run/run_file.h"
#include "pipeline/stages/styled_field.h"
#include "pipeline/workspace/style_folders.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

struct SheetOptions {
  std::string out;
  int views = 3;
  int size = 320;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("out", out, {.help = "the picture to write, a PNG file"});
    bind("views", views,
         {.unit = "photos",
          .help = "photos shown of each style, evenly spaced",
          .min = 1,
          .max = 100});
    bind("size", size,
         {.unit = "pixels",
          .help = "longer side of each picture on the sheet",
          .min = 64,
          .max = 4096});
  }
};

// Views evenly spaced among all.
std::vector<int> ShownViews(int views, int count) {
  std::vector<int> shown;
  const int most = std::min(count, views);
  for (int k = 0; k < most; ++k) shown.push_back((2 * k + 1) * views / (2 * most));
  return shown;
}

Image Clipped(Image image) {
  for (float& v : image.pixels) v = std::isfinite(v) ? std::clamp(v, 0.0f, 1.0f) : v;
  return image;
}

// A row for each shown view: the photo, and each style as it is in the folder.
std::vector<SheetRow> RowsOfStyles(const WorkingViews& views, const std::vector<int>& shown,
                                   StoredField geometry, const std::string& folder,
                                   const Arguments& names) {
  std::vector<SheetRow> rows(shown.size());
  for (size_t k = 0; k < rows.size(); ++k)
    rows[k].push_back({views.Photo(shown[k]), views.View(shown[k]).file});
  std::vector<Camera> cameras;
  for (const int i : shown) cameras.push_back(views.CameraOf(i));
  const StoredField seen = SeenPart(std::move(geometry), folder + "/field.npz", cameras);
  for (const std::string& name : names) {
    const std::string style = StyleFolder(folder, name);
    StoredField styled = StyledFieldOf(seen, style, StrengthOf(style));
    const FieldRenderer renderer(std::move(styled.field), Backend::kCpu);
    for (size_t k = 0; k < rows.size(); ++k)
      rows[k].push_back({Clipped(renderer.Render(cameras[k]).color), name});
  }
  return rows;
}

// The styles of the folder that `words` behind it name; all that were learned without any.
Arguments StylesAmong(const Arguments& words, Console* console) {
  const std::string& folder = words[0];
  Arguments styles;
  for (size_t i = 1; i < words.size(); ++i)
    styles.push_back(ChosenLearnedStyle(folder, words[i]));
  if (words.size() > 1) return styles;
  Arguments left;
  styles = LearnedStyles(folder, &left);
  if (styles.empty()) ChosenLearnedStyle(folder, left.empty() ? "" : left[0]);  // refuses
  if (!left.empty()) console->Info(LeftOutText(folder, left));
  return styles;
}

}  // namespace

void RunContactSheet(const Command& command, const Arguments& arguments, Console* console) {
  SheetOptions sheet;
  ProgramOptions program;
  OptionSet options;
  options.Add("Sheet", &sheet);
  options.Add("Program", &program);
  constexpr size_t kMostStyles = 64;
  const auto prepared =
      Prepare(command, arguments, {.least_words = 1, .most_words = 1 + kMostStyles}, &options);
  if (!prepared) return;
  const std::string& folder = prepared->words[0];
  if (!fs::exists(folder + "/field.npz"))
    throw InputError("holds no reconstruction", folder,
                     "make one with `regrade run` or `regrade reconstruct`");
  RequireValue(sheet.out, "--out", "name the PNG file to write");
  Workspace workspace(folder);
  const Arguments styles = StylesAmong(prepared->words, console);
  if (!sheet.out.ends_with(".png"))
    throw UsageError("'" + sheet.out + "' is no PNG file", "--out", "name it FILE.png");
  CheckResults(folder, styles);
  StoredField geometry = ReadFieldGeometry(workspace.Path("field.npz"));
  const WorkingViews views =
      ReadWorkingViews(workspace.Path("poses"), sheet.size, 0).InField(geometry);
  const std::vector<int> shown = ShownViews(views.count(), sheet.views);
  const Image picture =
      MakeContactSheet(RowsOfStyles(views, shown, std::move(geometry), folder, styles));
  WritePng8(sheet.out, picture);
  console->Info(Concat("wrote ", sheet.out, ", ", picture.width, "x", picture.height));
}

}  // namespace regrade
