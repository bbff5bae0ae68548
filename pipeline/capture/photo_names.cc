#include "pipeline/capture/photo_names.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>

#include "kernels/base/error.h"
#include "pipeline/capture/name_index.h"
#include "pipeline/files/folder_listing.h"
#include "pipeline/images/image_format.h"

namespace regrade {
namespace {

std::string StemOf(const std::string& name) {
  return std::filesystem::path(name).stem().string();
}

// By content or name, so that a damaged picture is reported rather than ignored.
bool IsMeantAsPicture(const std::string& path) {
  if (HasPictureName(path)) return true;
  std::string begin(4096, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  begin.resize(std::max<std::streamsize>(0, file.gcount()));
  return SniffImageFormat(begin, path) != nullptr;
}

// A photo whose name a picture has.
struct Match {
  size_t photo = 0;
  int closeness = 0;     // 0: none has it
  bool several = false;  // others are as close

  int Folders() const { return closeness / 2; }  // the part of it that folders have
};

// Photos by their names. Of photos with one name that are in different folders, the picture's
// own folders decide: COLMAP's masks of several cameras are masks/cam0/00000.jpg.png.
class PhotoFinder {
 public:
  explicit PhotoFinder(const std::vector<std::string>& photos) : photos_(photos) {
    for (size_t i = 0; i < photos.size(); ++i) by_stem_[StemOf(photos[i])].push_back(i);
  }

  Match Find(const std::string& picture) const {
    auto found = by_stem_.find(StemOf(picture));
    // IMG_7.jpg.png, as COLMAP names masks.
    if (found == by_stem_.end() && HasPictureName(StemOf(picture)))
      found = by_stem_.find(StemOf(StemOf(picture)));
    if (found == by_stem_.end()) return {};
    Match best;
    for (const size_t photo : found->second) {
      const int closeness = Closeness(photos_[photo], picture);
      if (closeness > best.closeness)
        best = {photo, closeness, false};
      else if (closeness == best.closeness)
        best.several = true;
    }
    return best;
  }

  // Photos that share a name and have no picture, while one is there that may be of each.
  std::string Twins(const std::vector<std::string>& paths, const std::string& unclear) const {
    std::string twins;
    for (const std::string& stem : {StemOf(unclear), StemOf(StemOf(unclear))})
      if (const auto found = by_stem_.find(stem); twins.empty() && found != by_stem_.end())
        for (const size_t photo : found->second)
          if (paths[photo].empty()) twins += (twins.empty() ? "" : ", ") + photos_[photo];
    return twins;
  }

  // A name that is found; of photos that share one, with its folder.
  std::string Example() const {
    for (const auto& [stem, photos] : by_stem_)
      if (photos.size() > 1)
        return std::filesystem::path(photos_[photos[0]]).replace_extension(".png").string() +
               " (two photos have the name \"" + stem + "\")";
    return StemOf(photos_[0]) + ".png";
  }

 private:
  // At least 2; more for each folder that the paths share at their ends, and for an ending that
  // the picture's name repeats.
  static int Closeness(const std::string& photo, const std::string& picture) {
    const std::filesystem::path a(photo), b(picture);
    const bool repeats = b.stem() == a.filename();
    int closeness = repeats ? 3 : 2;
    auto folder_a = a.parent_path(), folder_b = b.parent_path();
    for (; !folder_a.empty() && folder_a.filename() == folder_b.filename(); closeness += 2) {
      folder_a = folder_a.parent_path();
      folder_b = folder_b.parent_path();
    }
    // The same folders, not only the same end of them.
    return closeness + (folder_a.empty() && folder_b.empty() ? 2 : 0);
  }

  const std::vector<std::string>& photos_;
  std::map<std::string, std::vector<size_t>> by_stem_;
};

std::string SizeOf(const Image& image) { return Concat(image.width, " x ", image.height); }

}  // namespace

void CheckAspect(const Image& picture, int width, int height, const std::string& where,
                 ExitCode code) {
  // The ratios of the sides may differ by one pixel of the smaller picture.
  const double ratio_x = static_cast<double>(picture.width) / width;
  const double ratio_y = static_cast<double>(picture.height) / height;
  const double larger = std::max(ratio_x, ratio_y);
  const double slack = 1.0 / std::min({width, height, picture.width, picture.height});
  if (std::abs(ratio_x - ratio_y) > slack * larger)
    throw Error(code,
                Concat("has ", SizeOf(picture), " pixels, its view ", width, " x ", height),
                where, "keep the photo's aspect: do not crop or rotate");
}

std::vector<std::string> PicturesByPhotoName(const std::string& folder,
                                             const std::vector<std::string>& photos,
                                             const std::string& what) {
  const PhotoFinder finder(photos);
  std::vector<Match> best(photos.size());
  std::vector<std::string> paths(photos.size());
  std::vector<std::string> unclear;
  for (const ListedFile& file : ListFolder(folder).files) {
    const Match match = finder.Find(file.name);
    if (match.closeness == 0) continue;
    if (file.problem.empty() && !IsMeantAsPicture(file.path)) continue;
    if (match.several) {
      unclear.push_back(file.name);
      continue;
    }
    Match& before = best[match.photo];
    if (match.Folders() < before.Folders()) continue;
    if (!file.problem.empty()) throw InputError(file.problem, file.path);
    std::string& path = paths[match.photo];
    if (match.Folders() == before.Folders())
      throw InputError("two " + what + "s for the photo " + photos[match.photo],
                       path + " and " + file.path, "leave one of them");
    before = match;
    path = file.path;
  }
  for (const std::string& picture : unclear)
    if (const std::string twins = finder.Twins(paths, picture); !twins.empty())
      throw InputError("\"" + picture + "\" may belong to one of several photos: " + twins,
                       folder,
                       "put the " + what + "s into folders named like those of the photos");
  if (std::ranges::all_of(paths, [](const std::string& path) { return path.empty(); }))
    throw InputError("has no picture with the name of a photo", folder,
                     photos.empty() ? "" : "expected are names like " + finder.Example());
  return paths;
}

}  // namespace regrade
