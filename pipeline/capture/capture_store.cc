#include "pipeline/capture/capture_store.h"

#include <algorithm>
#include <filesystem>
#include <map>

#include "kernels/base/error.h"
#include "kernels/base/natural_order.h"
#include "pipeline/capture/llff_poses.h"
#include "pipeline/capture/transforms_json.h"
#include "pipeline/files/json_file.h"
#include "reconstruct/colmap/resized_model.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

bool HoldsModel(const fs::path& folder) {
  for (const char* ending : {".bin", ".txt"})
    if (fs::is_regular_file(folder / (std::string("cameras") + ending)) &&
        fs::is_regular_file(folder / (std::string("images") + ending)))
      return true;
  return false;
}

// The deepest folder that holds all pictures of a transforms.json.
fs::path CommonFolder(const fs::path& folder, const TransformsFile& file) {
  fs::path common;
  for (const TransformsFrame& frame : file.frames) {
    const fs::path parent = fs::weakly_canonical(folder / frame.file).parent_path();
    if (common.empty()) {
      common = parent;
      continue;
    }
    fs::path shared;
    for (auto a = common.begin(), b = parent.begin();
         a != common.end() && b != parent.end() && *a == *b; ++a, ++b)
      shared /= *a;
    common = shared;
  }
  return common;
}

// Where the pictures are; empty if there is no such folder.
fs::path PictureFolder(const fs::path& root) {
  if (fs::is_directory(root / "images")) return root / "images";
  std::vector<std::string> names;
  std::error_code error;  // the caller reports a folder that cannot be listed
  for (fs::directory_iterator it(root, error), end; !error && it != end; it.increment(error))
    if (const std::string name = it->path().filename().string();
        name.starts_with("images_") && fs::is_directory(it->path(), error))
      names.push_back(name);
  std::ranges::sort(names, NaturalLess);
  return names.empty() ? fs::path() : root / names[0];
}

// A model with one camera per image and no points, with staged names.
ColmapModel ModelFromTransforms(const CaptureSource& source,
                                const std::vector<StagedPhoto>& photos,
                                std::vector<std::string>* missing) {
  const fs::path folder = fs::path(source.poses).parent_path();
  std::map<std::string, const StagedPhoto*> by_path;
  for (const StagedPhoto& photo : photos)
    by_path[fs::weakly_canonical(fs::path(source.photos) / photo.file).string()] = &photo;
  const PictureSizeFunction size_of = [&by_path](const std::string& path, int* width,
                                                 int* height) {
    const auto found = by_path.find(fs::weakly_canonical(path).string());
    *width = found == by_path.end() ? 1 : found->second->width;
    *height = found == by_path.end() ? 1 : found->second->height;
  };
  ColmapModel model;
  const TransformsFile file = ReadTransformsJson(source.poses, size_of);
  *missing = file.missing;
  for (const TransformsFrame& frame : file.frames) {
    const auto found = by_path.find(fs::weakly_canonical(folder / frame.file).string());
    if (found == by_path.end()) continue;  // left out at ingest, with a reason
    const uint32_t id = static_cast<uint32_t>(model.images.size()) + 1;
    model.cameras.push_back({id, ColmapLensOf(frame.camera.lens), frame.camera});
    model.images.push_back({id, id, found->second->name, frame.camera.camera_from_world, {}});
  }
  return model;
}

// An LLFF file has one pose for each picture of its folder, in natural order.
ColmapModel ModelFromLlff(const CaptureSource& source, const std::vector<StagedPhoto>& photos,
                          double* nearest_depth) {
  const LlffPoses poses = ReadPosesBounds(source.poses);
  if (poses.cameras.size() != photos.size())
    throw InputError(Concat(poses.cameras.size(), " poses, but ", photos.size(),
                            " usable photos in ", source.photos),
                     source.poses,
                     "an LLFF file has no photo names: all of its pictures must be present");
  *nearest_depth = poses.nearest;
  ColmapModel model;
  for (size_t i = 0; i < photos.size(); ++i) {
    const uint32_t id = static_cast<uint32_t>(i) + 1;
    Camera camera = poses.cameras[i].Resized(photos[i].width, photos[i].height);
    model.cameras.push_back({id, ColmapLens::kPinhole, camera});
    model.images.push_back({id, id, photos[i].name, camera.camera_from_world, {}});
  }
  return model;
}

constexpr int64_t kSchema = 2;         // of photos.json
constexpr char kAbsent[] = "absent/";  // no staged photo's name has a slash
constexpr char kNoPicture[] = "has a pose, but the picture is missing";

void NoteMissing(const std::vector<PhotoStatus>& statuses, std::vector<std::string>* notes) {
  std::string first;
  int count = 0;
  for (const PhotoStatus& photo : statuses)
    if (photo.why == kNoPicture && count++ == 0) first = photo.file;
  if (count > 0)
    notes->push_back(Concat("the pictures of ", count, " poses are missing: ", first,
                            (count > 1 ? " and others" : "")));
}

JsonValue StatusesJson(const std::vector<PhotoStatus>& statuses) {
  JsonValue::Array array;
  for (const PhotoStatus& photo : statuses)
    array.push_back(JsonValue::Object{
        {"file", photo.file}, {"status", ToString(photo.status)}, {"why", photo.why}});
  return array;
}

std::string IndexOf(const CaptureSource& posed) {
  return (fs::path(posed.poses).parent_path() / "photos.json").string();
}

// photos.json. Throws Error(kInput) for one of another schema.
JsonValue ReadIndex(const std::string& path) {
  JsonValue index = ReadJsonFile(path);
  const JsonValue* const schema = index.IsObject() ? index.Find("schema") : nullptr;
  if (schema == nullptr || !(*schema == JsonValue(kSchema)))
    throw InputError(Concat("is of schema ", (schema == nullptr ? "0" : DumpJson(*schema, -1)),
                            ", this version of regrade reads schema ", kSchema),
                     path, "start a new folder with `regrade run`, or use --restart-from pose");
  return index;
}

double NearestDepth(const JsonValue& index) {
  const JsonValue* depth = index.Find("nearest_depth");
  return depth == nullptr ? 0 : depth->AsDouble();
}

}  // namespace

double NearestDepthOf(const CaptureSource& source) {
  return source.kind == CaptureKind::kPosed ? NearestDepth(ReadIndex(IndexOf(source))) : 0;
}

CaptureSource DetectCapture(const std::string& folder) {
  std::error_code error;
  const fs::path root = fs::canonical(folder, error);
  if (error) throw InputError(error.message(), folder, "name a folder of photos, or a film");
  if (fs::is_regular_file(root)) return {CaptureKind::kPhotos, root.string(), ""};
  if (!fs::is_directory(root))
    throw InputError("is neither a folder nor a film", folder, "name a folder or a file");
  for (const char* name : {"transforms.json", "transforms_train.json"}) {
    const fs::path file = root / name;
    if (!fs::is_regular_file(file)) continue;
    const auto unknown_size = [](const std::string&, int* width, int* height) {
      *width = *height = 0;
    };
    const fs::path photos = CommonFolder(root, ReadTransformsJson(file.string(), unknown_size));
    return {CaptureKind::kTransforms, photos.string(), file.string()};
  }
  const fs::path pictures = PictureFolder(root);
  if (fs::is_regular_file(root / "poses_bounds.npy"))
    return {CaptureKind::kLlff, (pictures.empty() ? root : pictures).string(),
            (root / "poses_bounds.npy").string()};
  for (const fs::path& poses : {root / "poses", root})
    if (fs::is_regular_file(poses / "photos.json") && HoldsModel(poses / "sparse"))
      return {CaptureKind::kPosed, (poses / "photos").string(), (poses / "sparse").string()};
  if (!pictures.empty())
    for (const char* model : {"sparse", "sparse/0"})
      if (HoldsModel(root / model))
        return {CaptureKind::kColmap, pictures.string(), (root / model).string()};
  return {CaptureKind::kPhotos, root.string(), ""};
}

Capture ImportPoses(const CaptureSource& source, const std::vector<StagedPhoto>& photos,
                    const std::vector<PhotoStatus>& statuses, const std::string& sparse_folder,
                    std::vector<std::string>* notes) {
  ColmapModel model;
  double nearest_depth = 0;
  std::vector<std::string> missing;
  if (source.kind == CaptureKind::kTransforms) {
    model = ModelFromTransforms(source, photos, &missing);
  } else if (source.kind == CaptureKind::kLlff) {
    model = ModelFromLlff(source, photos, &nearest_depth);
  } else {
    model = ReadColmapModel(source.poses);
    nearest_depth = NearestDepthOf(source);
    // Images get staged names. An image without a staged photo gets a name that no photo has:
    // its own may be the staged name of another.
    std::map<std::string, std::string> name_of;
    for (const StagedPhoto& photo : photos) name_of[photo.file] = photo.name;
    for (ColmapImage& image : model.images)
      if (const auto found = name_of.find(image.name); found != name_of.end())
        image.name = found->second;
      else if (!image.name.starts_with(kAbsent))
        image.name = kAbsent + image.name;
  }
  if (const int resized = ResizeToPhotos(photos, &model); resized > 0)
    notes->push_back(
        std::to_string(resized) +
        " photos differ from their cameras in size, not in aspect: the cameras were "
        "resized");
  WriteColmapModel(model, sparse_folder);
  Capture capture = CaptureFromModel(model, photos, PhotoNames::kStaged);
  capture.nearest_depth = nearest_depth;
  std::vector<PhotoStatus> posed;
  for (const PhotoStatus& photo : capture.statuses)
    if (photo.status == PhotoState::kSkipped)
      missing.push_back(photo.file.substr(std::string(kAbsent).size()));
    else
      posed.push_back(photo);
  capture.statuses = MergeStatuses(statuses, posed);
  for (const std::string& file : missing)
    capture.statuses.push_back({file, PhotoState::kSkipped, kNoPicture});
  NoteMissing(capture.statuses, notes);
  return capture;
}

void WriteCaptureIndex(const std::string& folder, const Capture& capture,
                       const std::vector<StagedPhoto>& photos) {
  JsonValue::Array staged;
  for (const StagedPhoto& photo : photos)
    staged.push_back(JsonValue::Object{{"file", photo.file},
                                       {"name", photo.name},
                                       {"width", photo.width},
                                       {"height", photo.height},
                                       {"exif_focal_px", photo.exif_focal_px}});
  WriteJsonFile(folder + "/photos.json",
                JsonValue::Object{{"schema", kSchema},
                                  {"photos", std::move(staged)},
                                  {"statuses", StatusesJson(capture.statuses)},
                                  {"reprojection_px", capture.reprojection_px},
                                  {"nearest_depth", capture.nearest_depth},
                                  {"models_found", capture.models_found}});
}

Capture ReadCapture(const std::string& folder) {
  const std::string path = folder + "/photos.json";
  const JsonValue index = ReadIndex(path);
  try {
    std::vector<StagedPhoto> photos;
    for (const JsonValue& entry : index.At("photos").AsArray()) {
      StagedPhoto photo;
      photo.file = entry.At("file").AsString();
      photo.name = entry.At("name").AsString();
      if (fs::path(photo.name).filename() != photo.name)
        throw InputError("a photo's name is a path");
      photo.path = folder + "/photos/" + photo.name;
      photo.width = static_cast<int>(entry.At("width").AsInt());
      photo.height = static_cast<int>(entry.At("height").AsInt());
      photo.exif_focal_px = entry.At("exif_focal_px").AsDouble();
      photos.push_back(std::move(photo));
    }
    Capture capture =
        CaptureFromModel(ReadColmapModel(folder + "/sparse"), photos, PhotoNames::kStaged);
    capture.statuses.clear();
    for (const JsonValue& photo : index.At("statuses").AsArray()) {
      const auto state = PhotoStateOf(photo.At("status").AsString());
      if (!state)
        throw InputError("'" + photo.At("status").AsString() + "' is not a photo's status");
      capture.statuses.push_back(
          {photo.At("file").AsString(), *state, photo.At("why").AsString()});
    }
    capture.reprojection_px = index.At("reprojection_px").AsDouble();
    capture.nearest_depth = NearestDepth(index);
    capture.models_found = static_cast<int>(index.At("models_found").AsInt());
    return capture;
  } catch (const Error& error) {
    throw InputError(error.what_failed(), error.where().empty() ? path : error.where(),
                     error.hint());
  }
}

}  // namespace regrade
