// Writes the page: one HTML file with the field, the styles, and what draws them.
//
// A page holds no metadata of photos; pictures in it are encoded anew. Names of styles and
// photos are in it where its maker wants them, and nothing of where they are stored.
// Its policy lets it load nothing: style sheet and script are named by their hashes.
#pragma once

#include <string>
#include <vector>

#include "kernels/image/color_statistics.h"
#include "kernels/scene/camera.h"
#include "pipeline/page/check_page.h"
#include "pipeline/page/field_codec.h"
#include "pipeline/page/style_codec.h"

namespace regrade {

struct PagePhoto {
  int camera = 0;    // index of PageContent::cameras
  std::string jpeg;  // a thumbnail
  std::string name;  // printable; empty: it has none in the page
};

struct PageContent {
  PageField field;
  std::vector<PageStyle> styles;
  std::vector<std::string> style_pictures;  // JPEG, of each style: the home view
  std::vector<Camera> cameras;              // of the photos, in the field's frame
  int home = 0;                             // the camera where the page begins
  std::vector<PagePhoto> photos;
  std::string poster;      // JPEG: the home view
  ColorStatistics colors;  // of the photos: what a dropped picture's colours replace
  bool served = false;     // may ask the server that it came from
};

// The text of the page. `check` may be null.
std::string PageHtml(const PageContent& content, const PageCheck* check);

// What `regrade view` answers first, and its policy: it asks for the page and becomes it.
std::string OpeningHtml();
std::string OpeningPolicy();

// The camera whose place is nearest to the mean of all, of those that look at what most see.
int HomeCamera(const std::vector<Camera>& cameras);

}  // namespace regrade
