#include "pipeline/capture/capture_source.h"

#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/capture/given_colmap_model.h"
#include "pipeline/capture/measured_depths.h"
#include "pipeline/capture/nsvf_cameras.h"
#include "pipeline/capture/picture_folders.h"
#include "pipeline/capture/transforms_source.h"
#include "pipeline/files/text.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

bool IsFile(const fs::path& path) {
  std::error_code none;
  return fs::is_regular_file(path, none);
}

bool IsFolder(const fs::path& path) {
  std::error_code none;
  return fs::is_directory(path, none);
}

CaptureSource NsvfSource(const fs::path& root, const fs::path& poses,
                         const fs::path& pictures) {
  CaptureSource source{CaptureKind::kNsvf, pictures.string(), poses.string()};
  source.intrinsics = (root / "intrinsics.txt").string();
  if (IsFile(root / "bbox.txt")) source.box = (root / "bbox.txt").string();
  std::vector<std::string> names;
  std::error_code error;  // ingest reports a folder that cannot be listed
  for (fs::directory_iterator it(pictures, error), end; !error && it != end;
       it.increment(error))
    names.push_back(it->path().filename().string());
  NsvfSplit split = SplitNsvf(names);
  source.only = std::move(split.only);
  source.test = std::move(split.test);
  return source;
}

// Polycam's pictures are undistorted in corrected_images/, and whole in images/.
CaptureSource PolycamSource(const fs::path& keyframes) {
  for (const std::string kind : {"corrected_", ""}) {
    const fs::path pictures = keyframes / (kind + "images"),
                   poses = keyframes / (kind + "cameras");
    if (!IsFolder(pictures) || !IsFolder(poses)) continue;
    CaptureSource source{CaptureKind::kPolycam, pictures.string(), poses.string()};
    std::error_code error;
    for (fs::directory_iterator it(pictures, error), end; !error && it != end;
         it.increment(error)) {
      const fs::path map = keyframes / "depth" / it->path().stem().concat(".png");
      if (IsFile(map)) source.depths[it->path().filename().string()] = map.string();
    }
    source.notes.push_back("a raw export of Polycam: " + kind + "images and " + kind +
                           "cameras of its keyframes are taken" +
                           (source.depths.empty() ? "" : ", and their depths"));
    return source;
  }
  return {};
}

// Folders in PHOTOS that are no photos, and what is said of them and of a model that is not
// used.
void LeaveFolders(const fs::path& root, CaptureSource* source) {
  std::vector<std::string> names;
  for (const fs::path& around : {root, root / "keyframes"})
    for (const fs::path& folder : FoldersBesidePictures(around)) {
      source->not_photos.push_back(folder.string());
      names.push_back(folder.lexically_relative(root).string());
    }
  if (!names.empty())
    source->notes.push_back("left out beside the pictures: " + Join(names, ", ") +
                            " (other sizes, depth or masks; masks are given with --photo-masks "
                            "or --masks)");
  if (const fs::path model = ColmapModelElsewhere(root); !model.empty())
    source->notes.push_back(model.string() +
                            " is a COLMAP model that is not used: to use it, give a folder "
                            "with the photos in images/ "
                            "and the model in sparse/0/");
}

CaptureSource SourceOf(const fs::path& root) {
  if (CaptureSource transforms = TransformsSource(root); !transforms.poses.empty())
    return transforms;
  const fs::path pictures = PictureFolder(root);
  if (!pictures.empty() && IsFile(root / "intrinsics.txt"))
    for (const char* name : {"pose", "poses"})
      if (IsFolder(root / name)) return NsvfSource(root, root / name, pictures);
  if (!pictures.empty())
    for (const char* name : {"cameras.npz", "cameras_sphere.npz"})
      if (IsFile(root / name))
        return {CaptureKind::kDtu, pictures.string(), (root / name).string()};
  if (IsFile(root / "poses_bounds.npy"))
    return {CaptureKind::kLlff, (pictures.empty() ? root : pictures).string(),
            (root / "poses_bounds.npy").string()};
  for (const fs::path& poses : {root / "poses", root})
    if (IsFile(poses / "photos.json") && HoldsColmapModel(poses / "sparse")) {
      CaptureSource posed{CaptureKind::kPosed, (poses / "photos").string(),
                          (poses / "sparse").string()};
      FindStagedDepths((poses / "depths").string(), &posed.depths, &posed.depth_unit);
      return posed;
    }
  if (const GivenColmapModel given = FindColmapModel(root); !given.model.empty()) {
    CaptureSource source{CaptureKind::kColmap, given.pictures.string(), given.model.string()};
    if (!given.note.empty()) source.notes.push_back(given.note);
    return source;
  }
  for (const fs::path& keyframes : {root / "keyframes", root})
    if (CaptureSource polycam = PolycamSource(keyframes); !polycam.poses.empty())
      return polycam;
  CaptureSource source{CaptureKind::kPhotos, root.string(), ""};
  LeaveFolders(root, &source);
  return source;
}

}  // namespace

bool LacksPoints(CaptureKind kind) {
  return kind == CaptureKind::kTransforms || kind == CaptureKind::kLlff ||
         kind == CaptureKind::kNsvf || kind == CaptureKind::kDtu ||
         kind == CaptureKind::kPolycam;
}

CaptureSource DetectCapture(const std::string& folder,
                            const std::vector<std::string>& not_photos) {
  std::error_code error;
  const fs::path root = fs::canonical(folder, error);
  if (error) throw InputError(error.message(), folder, "name a folder of photos, or a film");
  if (fs::is_regular_file(root)) return {CaptureKind::kPhotos, root.string(), ""};
  if (!fs::is_directory(root))
    throw InputError("is neither a folder nor a film", folder, "name a folder or a file");
  CaptureSource source = SourceOf(root);
  for (const std::string& other : not_photos)
    if (!other.empty())
      source.not_photos.push_back(fs::weakly_canonical(other, error).string());
  return source;
}

}  // namespace regrade
