// Names of files in the output folder.
#pragma once

#include <string>

#include "kernels/base/error.h"

namespace regrade {

// Prefix of the film's frame sequences, beside those at the photos' positions:
// frames/path_source/, ...
inline constexpr char kPathPrefix[] = "path_";
// Where photos differ in size or lens, frames/common_source/, ... hold the views' frames again,
// with one camera (kernels/scene/common_camera.h) at each photo's position: neighbouring views
// are compared on these.
inline constexpr char kCommonPrefix[] = "common_";

// frames/edited/, frames/path_edited/: where an edit of single photos says what a frame should
// be.
inline constexpr char kEditedFrames[] = "edited";

// Of `regrade retouch`, in the style's folder: what was found in the edit, and its map of
// colours as a LUT.
inline constexpr char kRetouchRecord[] = "retouch.json", kEditLut[] = "edit.cube";

inline constexpr char kStyledFilm[] = "styled.mp4", kWipeFilm[] = "source_vs_styled.mp4",
                      kViews2dFilm[] = "views_2d.mp4";

// The page to walk in; report.html links to it.
inline constexpr char kScenePage[] = "scene.html";

// Films of camera paths that were made in a page.
inline constexpr char kFilmsFolder[] = "films";

// Of `regrade render --part`, in the style's folder.
inline constexpr char kPartsFolder[] = "parts";

// Of `regrade refine`.
inline constexpr char kBlocksFolder[] = "blocks";

// What `regrade evaluate --splats` renders.
inline constexpr char kRenderedFolder[] = "rendered";

// Retouched photos without what is left out of their edits.
inline constexpr char kRetouchedFolder[] = "retouched";

// What is at the top of the output folder and of a style's, besides `styles`: files and whole
// folders of our own.
inline constexpr const char* kOwnNames[] = {
    ".regrade",     "run.json",    "poses",         "field.npz",
    "field_2d.npz", "network.npz", "object.npz",    "residual.npz",
    "styled.npz",   "styled.ply",  "views_2d",      "frames",
    "heatmaps",     "stills",      "layers",        kRetouchedFolder,
    "retouch",      "edit.cube",   "retouch.json",  "report.json",
    "report.html",  kScenePage,    kFilmsFolder,    kStyledFilm,
    kWipeFilm,      kViews2dFilm,  kRenderedFolder, "styles/.pictures",
    kPartsFolder,   kBlocksFolder};

// "00007.png"
inline std::string FrameName(int index) { return Format("%05d.png", index); }

}  // namespace regrade
