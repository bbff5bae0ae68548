// `regrade evaluate --pst50`: pictures of a 2D method against the paired ground truth of PST50.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "evaluate/paired_quality.h"
#include "kernels/base/progress.h"
#include "pipeline/files/json_file.h"

namespace regrade {

// PST50 as its authors distribute it (Gong et al. 2025):
//   content_709/1.png ... 50.png   pictures, Rec. 709
//   content_log/                   the same, log encoded; not read
//   paired_style/, paired_gt/      the style of each, and what a colourist made of it
//   unpaired_style/, video/        without ground truth; not read
// Names pair the files; any number and any format of pictures is taken.
struct PairedFolder {
  std::string folder;
  std::string results;    // the method's picture of each content, of the same names
  bool controls = false;  // adds control_linear_map: the content under one linear map (MKL) of
                          // its colours onto the style's
};

// Rows: the method's pictures ("result"), the content as it is ("content"), the control. Errors
// (kInput): a folder or picture is missing, or a picture has another size than its ground
// truth; names the file.
std::vector<PairedRow> MeasurePairedFolder(
    const PairedFolder& benchmark,
    const std::function<double(const Image&, const Image&)>& perceptual,
    const ProgressFunction& progress);

// {"paired": [{"pictures_of", "number", "psnr_db", "ssim", "histogram_correlation", "lpips"}],
// "pictures": [the same of each picture, with "name"]}
JsonValue PairedJson(const std::vector<PairedRow>& rows);

}  // namespace regrade
