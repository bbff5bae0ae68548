// Compares the 2D methods that need nothing on folders of pictures, in their order of names:
//
//   method_benchmark METHOD[,METHOD...] STYLE.jpg[,STYLE.jpg...] SIDE SHEET.png FOLDER...
//
// METHOD is as of --method: mkl, gmm, reinhard or onnx:DIR; gmm+height is gmm
// with height-weight 1. Pictures are brought to SIDE pixels. SHEET.png shows one picture of
// each folder in each style, by each method; "-" writes none. Prints a Markdown table; a row is
// a mean over folders and styles, the worst in brackets: the distance of the styled pictures'
// colours to the style's (sliced Wasserstein), structure (correlation of edges with the
// picture), temporal consistency of neighbours (lai2018, dis-medium, which suits neighbours
// that overlap), the steepest slope between neighbouring pixels' colours that differ by a step
// of 4 to 32 of 255 (the 99.9 % quantile), and seconds a picture with the map's own measuring.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>

#include "evaluate/consistency.h"
#include "evaluate/image_quality.h"
#include "evaluate/sliced_wasserstein.h"
#include "kernels/image/resize.h"
#include "pipeline/files/folder_listing.h"
#include "pipeline/files/text.h"
#include "pipeline/images/contact_sheet.h"
#include "pipeline/images/image_file.h"
#include "stylize/image/color_transfer.h"
#include "stylize/image/gaussian_mixture.h"
#include "stylize/image/mixture_transfer.h"
#include "stylize/image/onnx_stylizer.h"
#include "stylize/image/sample_colors.h"

namespace regrade {
namespace {

struct Row {
  std::vector<double> distance, structure, consistency, slope, seconds;
};

std::unique_ptr<ViewStylizer> Make(const StyleOptions& options, const Image& style,
                                   const std::vector<Image>& photos) {
  const StyleMethod method = ParseStyleMethod(options);
  const StyleMethodKind kind = method.kind;
  if (kind == StyleMethodKind::kOnnx)
    return MakeOnnxStylizer(method.argument, options.max_side, style);
  std::vector<double> heights;
  const auto sample = [&](int64_t all) {
    std::vector<Vec3d> scene;
    for (const Image& photo : photos) {
      std::vector<double> of_photo;
      const int64_t most = std::max<int64_t>(256, all / std::ssize(photos));
      for (const Vec3d& c : SampleColors(photo, "", most, &of_photo)) scene.push_back(c);
      heights.insert(heights.end(), of_photo.begin(), of_photo.end());
    }
    return scene;
  };
  if (kind == StyleMethodKind::kGmm) {
    const std::vector<Vec3d> scene = sample(kMixtureSample);
    return MakeMixtureTransfer(options, style, scene, heights);
  }
  std::vector<ColorStatistics> parts;
  for (const Image& photo : photos) parts.push_back(MeasureForMethod(options, photo));
  const ColorStatistics scene = Pool(parts);
  return MakeColorTransfer(options, style, &scene);
}

// Ratios of distances of neighbouring pixels' colours, after and before.
void AddSlopes(const Image& before, const Image& after, std::vector<double>* slopes) {
  for (int y = 0; y < before.height; ++y)
    for (int x = 0; x + 1 < before.width; ++x) {
      const auto apart = [&](const Image& image) {
        const float *p = image.at(x, y), *q = image.at(x + 1, y);
        return std::hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]);
      };
      const double d = apart(before);
      if (d > 4.0 / 255 && d < 32.0 / 255) slopes->push_back(apart(after) / d);
    }
}

// Returns the styled picture in the middle.
Image Measure(const StyleOptions& options, const Image& style, const std::vector<Image>& photos,
              Row* row) {
  const auto begin = std::chrono::steady_clock::now();
  const std::unique_ptr<ViewStylizer> method = Make(options, style, photos);
  std::vector<Image> styled;
  for (size_t i = 0; i < photos.size(); ++i)
    styled.push_back(method->Stylize(photos[i], static_cast<int>(i)));
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
  const double count = static_cast<double>(photos.size());
  row->seconds.push_back(taken.count() / count);
  ColourSlices colours, of_style;
  of_style.Add(style);
  double structure = 0;
  std::vector<double> slopes;
  for (size_t i = 0; i < photos.size(); ++i) {
    for (float& v : styled[i].pixels) v = std::clamp(v, 0.0f, 1.0f);
    colours.Add(styled[i]);
    structure += GradientCorrelation(styled[i], photos[i]).value_or(0) / count;
    AddSlopes(photos[i], styled[i], &slopes);
  }
  row->distance.push_back(SlicedWasserstein(colours, of_style).value_or(NAN));
  row->structure.push_back(structure);
  const auto steep =
      slopes.begin() + static_cast<int64_t>(0.999 * static_cast<double>(slopes.size()));
  std::nth_element(slopes.begin(), steep, slopes.end());
  row->slope.push_back(steep == slopes.end() ? 0 : *steep);
  const auto source = [](const std::vector<Image>& images) {
    return FrameSource{static_cast<int>(images.size()),
                       [&images](int i) { return images[static_cast<size_t>(i)]; }};
  };
  ConsistencyOptions consistency;
  consistency.gaps = {1};
  const ConsistencyReport report =
      EvaluateConsistency(source(photos), {{"2d", source(styled)}}, consistency);
  row->consistency.push_back(report.rows.at(0).tc_psnr_mean_db.value_or(NAN));
  return styled[styled.size() / 2];
}

std::string Cell(const std::vector<double>& values, int digits, bool low_is_worst) {
  double sum = 0, worst = values[0];
  for (const double v : values) {
    sum += v;
    worst = low_is_worst ? std::min(worst, v) : std::max(worst, v);
  }
  char text[80];
  std::snprintf(text, sizeof text, "%.*f (%.*f)", digits,
                sum / static_cast<double>(values.size()), digits, worst);
  return text;
}

int Main(const std::vector<std::string>& words) {
  const int side = std::stoi(words.at(2));
  std::vector<Image> styles;
  for (const std::string& path : Split(words.at(1), ','))
    styles.push_back(ReadStylePicture(path, nullptr));
  std::vector<std::vector<Image>> captures;
  for (size_t k = 4; k < words.size(); ++k) {
    captures.emplace_back();
    for (const ListedFile& file : ListFolder(words[k]).files) {
      const Image photo = DecodePhoto(file.path).image;
      const double scale = static_cast<double>(side) / std::max(photo.width, photo.height);
      captures.back().push_back(Resize(photo, static_cast<int>(photo.width * scale),
                                       static_cast<int>(photo.height * scale)));
    }
  }
  std::vector<SheetRow> rows;
  for (const std::vector<Image>& photos : captures)
    for (size_t s = 0; s < styles.size(); ++s)
      rows.push_back({{photos[photos.size() / 2], "photo"}});
  std::printf(
      "| method | distance to the style | structure | TC, dB | slope | s a picture |\n");
  std::printf("|---|---|---|---|---|---|\n");
  for (const std::string& given : Split(words.at(0), ','))
    for (const bool scene_wide : {false, true}) {
      StyleOptions options;
      options.method = given;
      const std::string name = given.starts_with("onnx:") ? "onnx" : given;
      if (given == "gmm+height") {
        options.method = "gmm";
        options.height_weight = 1;
      }
      if (name == "onnx" && scene_wide) continue;
      options.scene_wide = scene_wide;
      Row row;
      const std::string caption = name + (scene_wide ? " scene-wide" : "");
      size_t at = 0;
      for (const std::vector<Image>& photos : captures)
        for (const Image& style : styles)
          rows[at++].push_back({Measure(options, style, photos, &row), caption});
      std::printf("| `%s`%s | %s | %s | %s | %s | %s |\n", name.c_str(),
                  scene_wide ? " scene-wide" : "", Cell(row.distance, 3, false).c_str(),
                  Cell(row.structure, 3, true).c_str(), Cell(row.consistency, 2, true).c_str(),
                  Cell(row.slope, 1, false).c_str(), Cell(row.seconds, 3, false).c_str());
      std::fflush(stdout);
    }
  if (words.at(3) != "-") WritePng8(words.at(3), MakeContactSheet(rows));
  return 0;
}

}  // namespace
}  // namespace regrade

int main(int count, char** words) {
  if (count < 6) {
    std::fprintf(stderr,
                 "usage: method_benchmark METHOD[,METHOD...] STYLE[,STYLE...] SIDE SHEET.png "
                 "FOLDER...\n");
    return 2;
  }
  return regrade::Main(std::vector<std::string>(words + 1, words + count));
}
