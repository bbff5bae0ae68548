// What each file of a folder of photos is: a photo, a film, or something beside them.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "pipeline/files/folder_listing.h"

namespace regrade {

enum class InputKind {
  kPhoto,  // may be a photo: decoding decides
  kClip,   // a film
  kLeft,   // neither
};

struct InputFile {
  ListedFile file;
  InputKind kind = InputKind::kPhoto;
  std::string left_as;  // kLeft: what it counts as, "live-photo clip"
  std::string why;      // kLeft: "the live-photo clip of IMG_1.HEIC"
};

struct InputFiles {
  std::vector<InputFile> files;   // in natural order of names
  int hidden = 0;                 // files and folders whose name begins with a dot
  std::vector<std::string> runs;  // folders with results of our own, which are no photos

  int Count(InputKind kind) const;
};

// The files of a folder and its subfolders, or the one film that `path` is; decided by content,
// but for the names that cameras give to their own small copies. Left are: cameras' thumbnails
// (.thm) and small films (.lrv, .lrf); the clip of a live photo, which is a film of at most
// kLongestLiveClip seconds beside a picture of the same name; a camera raw file beside a
// picture of the same name, which the camera or the user developed from it; films, where
// `take_clips` is false. Files in the folders `not_photos` (absolute paths) are not listed. If
// `only` is not empty, its files alone are looked at, wherever links lead. Throws as
// ListFolder, and Error(kInput) for a path that is a file and no film.
InputFiles ListInputs(const std::string& path, bool take_clips = true,
                      const std::set<std::string>& only = {},
                      const std::vector<std::string>& not_photos = {});
inline constexpr double kLongestLiveClip = 6;

// By its header; 0 if that cannot be read.
double SecondsOfFilm(const std::string& path);

// "12 of 4032 x 3024, 8 of 3024 x 4032" and the like: counts in descending order, the first
// five.
std::string CountsText(const std::map<std::string, int>& counts, const std::string& between);

}  // namespace regrade
