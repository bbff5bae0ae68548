// What a folder of photos is: photos alone, or with poses in one of the known layouts.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

namespace regrade {

// Where the poses of a capture come from.
enum class CaptureKind {
  kPhotos,      // none: COLMAP finds them
  kPosed,       // an output folder of regrade, or its poses/: photos.json, photos/ and sparse/
  kColmap,      // a folder of pictures beside a model (given_colmap_model.h)
  kTransforms,  // transforms.json, or transforms_train.json of a Blender capture
  kLlff,        // poses_bounds.npy beside a folder of pictures, or among them
  kNsvf,        // intrinsics.txt and pose/ beside a folder of pictures
  kDtu,         // cameras.npz beside a folder of pictures
  kPolycam,     // keyframes/ with a camera for each picture
};

struct CaptureSource {
  CaptureKind kind = CaptureKind::kPhotos;
  std::string photos;  // the folder to take photos from, or a film; absolute
  std::string poses;   // folder of the model or of the files of poses, or their file; or empty
  std::string test_poses = {};      // a second file of poses, of test photos; or empty
  std::string intrinsics = {};      // of kNsvf
  std::string box = {};             // a file with the scene's box, or empty
  std::set<std::string> only = {};  // photos to take, relative to `photos`; empty: all
  std::set<std::string> test = {};  // of them, those for tests; empty: not said
  // By photo: the mask that the poses name for it, an absolute path.
  std::map<std::string, std::string> masks = {};
  // Likewise, maps of measured depths (measured_depths.h), and their unit in world units.
  std::map<std::string, std::string> depths = {};
  double depth_unit = 1e-3;
  std::vector<std::string> not_photos = {};  // folders in `photos` that are left; absolute
  std::vector<std::string> notes = {};  // sentences for the user: what was chosen, what is left
};

// Whether such poses come without points.
bool LacksPoints(CaptureKind kind);

// Decides by content. A file counts as a film, of which poses are found. The folder of pictures
// beside poses is that of picture_folders.h. Of transforms.json only the pictures that it names
// are taken; transforms_test.json beside transforms_train.json names photos for tests, as do
// nerfstudio's test_filenames and NSVF's prefixes, which leave others out. `not_photos`:
// folders that are known to be none, such as those of masks; empty texts count for nothing.
// Throws Error(kInput) if there is no such folder.
CaptureSource DetectCapture(const std::string& folder,
                            const std::vector<std::string>& not_photos = {});

}  // namespace regrade
