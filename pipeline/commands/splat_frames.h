// Frames of files of splats at the same cameras, with what exact motion needs.
#pragma once

#include <string>
#include <vector>

#include "pipeline/program/console.h"
#include "pipeline/run/run_settings.h"

namespace regrade {

struct SplatFrames {
  std::string reference;            // file of the unstyled splats
  std::vector<std::string> styled;  // files in its world
  SplatInput views;                 // without cameras they are placed in the reference
  std::string background = "auto";  // see SplatsOptions
  int size = 800;                   // longer side of the frames at most, in pixels
  std::string folder;               // where they are written, an existing folder
};

// Names of folders in SplatFrames::folder.
inline constexpr char kReferenceFrames[] = "source", kReferenceDepth[] = "depth",
                      kFrameCameras[] = "transforms.json";

// Renders all files, on a GPU where there is one, as
//
//   source/00000.png, ...           the reference
//   styled/..., styled_2/..., ...   the others
//   depth/00000.npy, ...            the reference's depth, along the optical axis, in the unit
//   of
//                                   the cameras; 0 without a surface
//   transforms.json                 the cameras of source/
//
// in place of what an earlier call wrote there. Cameras in an order without jumps are the path;
// others, and placed ones, are flown past as a film does. All frames have one size.
//
// Returns sentences for below the tables: of files whose geometry is not the reference's.
// Errors: kInput for a file that is not read, cameras that are none, and a scene of which no
// camera sees anything; Interrupted.
std::vector<std::string> RenderSplatFrames(const SplatFrames& frames, Console* console);

}  // namespace regrade
