// The pictures of a report page, and what else of it is not numbers.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline/report/camera_map.h"
#include "pipeline/report/picture.h"

namespace regrade {

// One viewpoint through all sequences; a missing picture is left out.
struct ReportView {
  std::string name;  // "00012, IMG_0420.jpg"
  std::optional<ReportPicture> photo, source, views_2d, styled;
};

// Where in the frame a pair's error lies, see ErrorHeatMap.
struct ReportHeatMap {
  std::string caption;  // "styled, frames 3 and 8"
  ReportPicture picture;
};

struct ReportPictures {
  std::string title;                   // the folder's name
  std::optional<ReportPicture> style;  // the style picture
  std::vector<ReportView> views;       // the middle one is the headline
  std::vector<ReportHeatMap> heat_maps;
  // A frame of the film's shape for styled.mp4 and views_2d.mp4 before they are played, where
  // the headline view may have another shape; else the headline view is taken.
  std::optional<ReportPicture> film_poster, film_poster_2d;
  bool has_styled_film = false;    // styled.mp4 lies beside the page
  bool has_wipe_film = false;      // source_vs_styled.mp4 does
  bool has_views_2d_film = false;  // views_2d.mp4 does
  // Of the photos in the order of their statuses; may be missing or fewer.
  std::vector<std::optional<ReportPicture>> thumbnails;
  CameraMap cameras;
  std::string chart_library;  // see ReadChartLibrary; may be empty
  std::string run_json;       // what repeats the run
};

}  // namespace regrade
