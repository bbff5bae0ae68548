// The pictures of a report page, and its other contents that are not numbers.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline/report/camera_map.h"
#include "pipeline/report/picture.h"

namespace regrade {

// One viewpoint in all sequences; a missing picture is left out.
struct ReportView {
  std::string name;  // "00012, IMG_0420.jpg"
  std::optional<ReportPicture> photo, source, views_2d, styled;
};

// Where in the frame a pair's error lies, see ErrorHeatMap.
struct ReportHeatMap {
  std::string caption;  // "styled scene, frames 3 and 8"
  ReportPicture picture;
};

// A film in the page's folder.
struct ReportFilm {
  std::string file;                     // "styled.mp4"
  std::string caption;                  // "the styled scene"
  std::optional<ReportPicture> poster;  // shown before the film is played
};

struct ReportPictures {
  std::string title;                   // the folder's name
  std::optional<ReportPicture> style;  // the style picture
  std::vector<ReportView> views;       // the middle one is the headline picture
  std::vector<ReportHeatMap> heat_maps;
  std::vector<ReportFilm> films;
  std::string scene_page;  // the page to walk in, in the page's folder; may be empty
  // Of the photos in the order of their statuses; may be missing or fewer.
  std::vector<std::optional<ReportPicture>> thumbnails;
  CameraMap cameras;
  std::string run_json;  // its text; may be empty
};

}  // namespace regrade
