#include "pipeline/capture/capture_store.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <set>

#include "kernels/base/error.h"
#include "pipeline/capture/given_models.h"
#include "pipeline/capture/name_index.h"
#include "pipeline/capture/nsvf_cameras.h"
#include "pipeline/capture/posed_orientation.h"
#include "pipeline/files/json_file.h"
#include "reconstruct/colmap/far_cameras.h"
#include "reconstruct/colmap/resized_model.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kSchema = 2;         // of photos.json
constexpr char kAbsent[] = "absent/";  // no staged photo's name has a slash
constexpr char kNoPicture[] = "has a pose, but the picture is missing";

void NoteMissing(const std::vector<PhotoStatus>& statuses, const NameIndex& names,
                 std::vector<std::string>* notes) {
  std::string first;
  int count = 0;
  for (const PhotoStatus& photo : statuses)
    if (photo.why == kNoPicture && count++ == 0) first = photo.file;
  if (count == 0) return;
  const std::string nearest = names.Nearest(first);
  notes->push_back(Concat("the pictures of ", count, " poses are missing: ", first,
                          (count > 1 ? " and others" : ""),
                          (nearest.empty() ? "" : "; the nearest name is " + nearest)));
}

// Gives images of the model staged names. An image without a staged photo gets a name that no
// photo has: its own may be the staged name of another.
void UseStagedNames(const CaptureSource& source, const std::vector<StagedPhoto>& photos,
                    ColmapModel* model, std::vector<std::string>* notes) {
  std::map<std::string, std::string> staged_of;  // by the user's names, without those in use
  for (const StagedPhoto& photo : photos) staged_of[photo.file] = photo.name;
  std::vector<ColmapImage*> others;
  for (ColmapImage& image : model->images)
    if (const auto found = staged_of.find(image.name); found != staged_of.end()) {
      image.name = found->second;
      staged_of.erase(found);
    } else {
      others.push_back(&image);
    }
  std::vector<std::string> free;
  for (const auto& [file, name] : staged_of) free.push_back(file);
  const NameIndex index(free);
  int renamed = 0;
  std::string first;
  for (ColmapImage* image : others) {
    // Names of our own are exact.
    const std::string file =
        source.kind == CaptureKind::kPosed ? std::string() : index.Find(image->name);
    const auto found = staged_of.find(file);
    if (found == staged_of.end()) {
      if (!image->name.starts_with(kAbsent)) image->name = kAbsent + image->name;
      continue;
    }
    if (renamed++ == 0) first = file + " is taken for \"" + image->name + "\"";
    image->name = found->second;
    staged_of.erase(found);
  }
  if (renamed > 0)
    notes->push_back(Concat(renamed, " pictures have other names than in the poses: ", first,
                            (renamed > 1 ? ", and so on" : "")));
  if (staged_of.size() < photos.size() || model->images.empty()) return;
  const std::string wanted = model->images[0].name.substr(std::string(kAbsent).size());
  const std::string nearest = index.Nearest(wanted);
  throw InputError(
      Concat("none of the pictures of its ", model->images.size(), " poses is there, e.g. \"",
             wanted, "\"", (nearest.empty() ? "" : "; nearest to it is \"" + nearest + "\"")),
      source.poses, "names are relative to " + source.photos);
}

// Says of photos that they are left out for their camera.
void NameFarCameras(const std::vector<FarCamera>& far, const std::vector<StagedPhoto>& photos,
                    std::vector<PhotoStatus>* statuses, std::vector<std::string>* notes) {
  for (const FarCamera& camera : far)
    for (const StagedPhoto& photo : photos) {
      if (photo.name != camera.image) continue;
      const std::string why =
          Format("its camera is %.3g times as far from the middle as the others", camera.times);
      for (PhotoStatus& status : *statuses)
        if (status.file == photo.file) status.why = why;
      notes->push_back(photo.file + ": left out, " + why);
    }
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

// The photos that are for tests, by "file" or "name".
std::set<std::string> TestPhotos(const JsonValue& index, const char* key) {
  std::set<std::string> test;
  for (const JsonValue& photo : index.At("photos").AsArray())
    if (const JsonValue* for_test = photo.Find("test");
        for_test != nullptr && for_test->AsBool())
      test.insert(photo.At(key).AsString());
  return test;
}

std::optional<WorldBox> BoxOf(const JsonValue& index) {
  const JsonValue* corners = index.Find("box");
  if (corners == nullptr) return std::nullopt;
  const JsonValue::Array& numbers = corners->AsArray();
  WorldBox box;
  if (numbers.size() != 6) throw InputError("the box is not two corners", corners->Place());
  for (int a = 0; a < 3; ++a) {
    box.low[a] = numbers[static_cast<size_t>(a)].AsDouble();
    box.high[a] = numbers[static_cast<size_t>(a) + 3].AsDouble();
  }
  if (!IsSound(box)) throw InputError("the box has no volume", corners->Place());
  return box;
}

double NearestDepth(const JsonValue& index) {
  const JsonValue* depth = index.Find("nearest_depth");
  return depth == nullptr ? 0 : depth->AsDouble();
}

}  // namespace

JsonValue KnownBesideModel(const CaptureSource& posed) {
  const JsonValue index = ReadIndex(IndexOf(posed));
  JsonValue known = JsonValue::Object{{"nearest_depth", NearestDepth(index)}};
  JsonValue::Array test;
  for (const std::string& name : TestPhotos(index, "name")) test.push_back(name);
  if (!test.empty()) known["test"] = std::move(test);
  if (const JsonValue* box = index.Find("box")) known["box"] = *box;
  return known;
}

Capture ImportPoses(const CaptureSource& source, std::vector<StagedPhoto>* staged,
                    const std::vector<PhotoStatus>& statuses, const std::string& sparse_folder,
                    std::vector<std::string>* notes) {
  std::vector<StagedPhoto>& photos = *staged;
  ColmapModel model;
  double nearest_depth = 0;
  std::vector<std::string> missing;
  std::set<std::string> test = source.test;  // the user's names
  std::optional<WorldBox> box;
  if (!source.box.empty()) box = ReadNsvfBox(source.box);
  if (LacksPoints(source.kind)) {
    model = ModelOfPoses(source, AsStored(photos), &nearest_depth, &missing);
  } else {
    model = ReadColmapModel(source.poses);
    if (source.kind == CaptureKind::kPosed) {
      const JsonValue index = ReadIndex(IndexOf(source));
      nearest_depth = NearestDepth(index);
      test = TestPhotos(index, "name");  // its photos are the staged ones
      box = BoxOf(index);
    }
    UseStagedNames(source, photos, &model, notes);
  }
  if (const std::string turned = MatchOrientations(&model, &photos); !turned.empty())
    notes->push_back(turned);
  const std::vector<FarCamera> far = TakeOutFarCameras(&model);
  if (const int resized = ResizeToPhotos(photos, &model); resized > 0)
    notes->push_back(
        std::to_string(resized) +
        " photos differ from their cameras in size, not in aspect: the cameras were "
        "resized");
  WriteColmapModel(model, sparse_folder);
  Capture capture = CaptureFromModel(model, photos, PhotoNames::kStaged);
  capture.nearest_depth = nearest_depth;
  capture.box = box;
  for (CaptureView& view : capture.views) view.test = test.contains(view.file);
  std::vector<PhotoStatus> posed;
  for (const PhotoStatus& photo : capture.statuses)
    if (photo.status == PhotoState::kSkipped)
      missing.push_back(photo.file.substr(std::string(kAbsent).size()));
    else
      posed.push_back(photo);
  NameFarCameras(far, photos, &posed, notes);
  capture.statuses = MergeStatuses(statuses, posed);
  for (const std::string& file : missing)
    capture.statuses.push_back({file, PhotoState::kSkipped, kNoPicture});
  std::vector<std::string> names;
  for (const PhotoStatus& photo : statuses) names.push_back(photo.file);
  NoteMissing(capture.statuses, NameIndex(names), notes);
  return capture;
}

void WriteCaptureIndex(const std::string& folder, const Capture& capture,
                       const std::vector<StagedPhoto>& photos) {
  std::set<std::string> test;
  for (const CaptureView& view : capture.views)
    if (view.test) test.insert(view.file);
  JsonValue::Array staged;
  for (const StagedPhoto& photo : photos) {
    JsonValue entry = JsonValue::Object{{"file", photo.file},
                                        {"name", photo.name},
                                        {"width", photo.width},
                                        {"height", photo.height},
                                        {"exif_focal_px", photo.exif_focal_px}};
    if (test.contains(photo.file)) entry["test"] = true;
    staged.push_back(std::move(entry));
  }
  JsonValue index = JsonValue::Object{{"schema", kSchema},
                                      {"photos", std::move(staged)},
                                      {"statuses", StatusesJson(capture.statuses)},
                                      {"reprojection_px", capture.reprojection_px},
                                      {"nearest_depth", capture.nearest_depth},
                                      {"models_found", capture.models_found}};
  if (capture.rendered) index["rendered"] = true;
  if (capture.box) {
    JsonValue::Array corners;
    for (const Vec3d& corner : {capture.box->low, capture.box->high})
      for (int a = 0; a < 3; ++a) corners.push_back(corner[a]);
    index["box"] = std::move(corners);
  }
  WriteJsonFile(folder + "/photos.json", std::move(index));
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
    capture.box = BoxOf(index);
    const std::set<std::string> test = TestPhotos(index, "file");
    for (CaptureView& view : capture.views) view.test = test.contains(view.file);
    capture.models_found = static_cast<int>(index.At("models_found").AsInt());
    const JsonValue* const rendered = index.Find("rendered");
    capture.rendered = rendered != nullptr && rendered->AsBool();
    return capture;
  } catch (const Error& error) {
    throw InputError(error.what_failed(), error.where().empty() ? path : error.where(),
                     error.hint());
  }
}

}  // namespace regrade
