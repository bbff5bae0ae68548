// What a folder of photos is: photos alone, or with poses in one of the known layouts.
#pragma once

#include <set>
#include <string>

namespace regrade {

// Where the poses of a capture come from.
enum class CaptureKind {
  kPhotos,      // none: COLMAP finds them
  kPosed,       // an output folder of regrade, or its poses/: photos.json, photos/ and sparse/
  kColmap,      // a folder of pictures beside sparse/ or sparse/0/
  kTransforms,  // transforms.json, or transforms_train.json of a Blender capture
  kLlff,        // poses_bounds.npy beside a folder of pictures, or among them
  kNsvf,        // intrinsics.txt and pose/ beside a folder of pictures
  kDtu,         // cameras.npz beside a folder of pictures
};

struct CaptureSource {
  CaptureKind kind = CaptureKind::kPhotos;
  std::string photos;           // the folder to take photos from, or a film; absolute
  std::string poses;            // folder of the model, or the file of poses; empty for kPhotos
  std::string test_poses = {};  // a second file of poses, of test photos; or empty
  std::string intrinsics = {};  // of kNsvf, whose `poses` is a folder
  std::string box = {};         // a file with the scene's box, or empty
  std::set<std::string> only = {};  // photos to take, relative to `photos`; empty: all
  std::set<std::string> test = {};  // of them, those for tests; empty: not said
};

// Whether such poses come without points.
bool LacksPoints(CaptureKind kind);

// Decides by content. A file counts as a film, of which poses are found. The folder of pictures
// beside poses is images/, rgb/ or image/, or else the first of images_2/, images_4/ and so on.
// transforms_test.json beside transforms_train.json names photos for tests, as do NSVF's
// prefixes; other photos than those that poses name are not taken then. Throws Error(kInput) if
// there is no such folder.
CaptureSource DetectCapture(const std::string& folder);

}  // namespace regrade
