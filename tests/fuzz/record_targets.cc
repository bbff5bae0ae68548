// Fuzz targets: transforms.json, run.json, stage records, camera paths, the index of a
// capture.
#include <algorithm>
#include <cmath>
#include <filesystem>

#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/transforms_json.h"
#include "pipeline/files/json_file.h"
#include "pipeline/page/keyframes.h"
#include "pipeline/run/run_file.h"
#include "pipeline/workspace/stage_record.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/mutate.h"
#include "tests/support/keyframes.h"
#include "tests/support/synthetic_model.h"

namespace regrade::testing {
namespace {

// --- transforms.json

const std::string& PictureFolder() {
  static std::string folder;
  if (folder.empty()) {
    folder = "transforms";
    std::filesystem::create_directories(FuzzFolder() + "/" + folder);
    for (const char* name : {"/0.png", "/1.jpg", "/2.png"}) FuzzFile(folder + name, "x");
  }
  return folder;
}

std::vector<std::string> TransformsSeeds() {
  PictureFolder();
  std::vector<TransformsFrame> frames;
  const ColmapModel model = MakeSyntheticModel({.images = 2, .points = 1});
  for (const ColmapImage& image : model.images)
    frames.push_back({frames.empty() ? "0.png" : "1.jpg", model.CameraOf(image)});
  const std::string path = FuzzFolder() + "/transforms/written.json";
  WriteTransformsJson(path, frames);
  std::vector<std::string> seeds = {ReadText(path)};
  frames[1].camera.fx = 555;
  frames[1].camera.lens = LensModel::kFisheye;
  frames[1].camera.distortion = {0.1, 0.01, 0, 1e-3};
  WriteTransformsJson(path, frames);
  seeds.push_back(ReadText(path));
  seeds.push_back(R"({"camera_angle_x": 0.69, "frames": [{"file_path": "./0",
 "rotation": 0.01, "transform_matrix": [[1,0,0,0.5],[0,1,0,1],[0,0,1,4],[0,0,0,1]]}]})");
  return seeds;
}

bool ReadTransforms(std::string_view bytes) {
  const std::string path = FuzzFile(PictureFolder() + "/transforms.json", bytes);
  return Accepts([&path] {
    const TransformsFile file = ReadTransformsJson(
        path, [](const std::string&, int* w, int* h) { *w = 640, *h = 480; });
    for (const TransformsFrame& frame : file.frames) {
      const Camera& c = frame.camera;
      const double side = std::max(c.width, c.height);
      FuzzRequire(c.width >= 1 && c.height >= 1, "a picture has a size");
      FuzzRequire(
          c.fx > 0.05 * side && c.fx < 100 * side && c.fy > 0.05 * side && c.fy < 100 * side,
          "a focal length is one of a lens");
      FuzzRequire(c.cx >= 0 && c.cx <= c.width && c.cy >= 0 && c.cy <= c.height,
                  "the principal point is in the picture");
      FuzzRequire(Norm(c.camera_from_world.translation) < 2e12, "no camera is at infinity");
      FuzzRequire(std::abs(c.camera_from_world.rotation.Determinant() - 1) < 1e-9,
                  "a pose is a rotation");
      FuzzRequire(std::filesystem::is_regular_file(FuzzFolder() + "/transforms/" + frame.file),
                  "its picture is there");
    }
  });
}

// --- run.json

std::vector<std::string> RunSeeds() {
  RunSettings settings;
  OptionSet options;
  settings.Bind(&options);
  const JsonValue values = options.Values();
  return {DumpJson(JsonValue::Object{
              {"schema", 2}, {"arguments", JsonValue::Array{"photos"}}, {"options", values}}),
          R"({"arguments": [], "options": {"seed": 3, "fit-rays": 512, "out": "x"}})"};
}

bool ReadRun(std::string_view bytes) {
  const std::string path = FuzzFile("run.json", bytes);
  return Accepts([&path] {
    const RunFile file = ReadRunFile(path);
    RunSettings settings, again;
    OptionSet options, others;
    settings.Bind(&options);
    options.ApplyConfig(file.options, path);
    again.Bind(&others);
    others.ApplyConfig(options.Values(), "again");
    FuzzRequire(others.Values() == options.Values(), "feeding it back repeats the options");
    CheckTogether(settings);
  });
}

// --- stage records

std::vector<std::string> RecordSeeds() {
  StageRecord record;
  record.version = "0.1.0";
  record.inputs = JsonValue::Object{{"photos", JsonValue::Object{{"a.jpg", "0123"}}}};
  record.outputs = {{"frames/styled/00000.png", 100, "89abcdef"}, {"field.npz", 5, "00"}};
  record.metrics = JsonValue::Object{{"voxels", 7}};
  return {DumpJson(ToJson(record))};
}

bool ReadRecord(std::string_view bytes) {
  return Accepts([bytes] {
    const StageRecord record = StageRecordFromJson(ParseJson(bytes, "record"), "record");
    for (const StageOutput& output : record.outputs) {
      const std::filesystem::path path = output.path;
      FuzzRequire(!path.is_absolute() && *path.begin() != "..", "no path leads out");
    }
    FuzzRequire(StageRecordFromJson(ToJson(record), "again").inputs == record.inputs,
                "a round trip keeps the inputs");
  });
}

// --- photos.json

std::vector<std::string> IndexSeeds() {
  const std::string folder = FuzzFolder() + "/poses";
  std::filesystem::create_directories(folder + "/sparse");
  const ColmapModel model = MakeSyntheticModel({.images = 3, .points = 4});
  WriteColmapModel(model, folder + "/sparse");
  const std::vector<StagedPhoto> photos = PhotosOf(model, 1);
  WriteCaptureIndex(folder, CaptureFromModel(model, photos), photos);
  return {ReadText(folder + "/photos.json")};
}

bool ReadIndex(std::string_view bytes) {
  if (!std::filesystem::exists(FuzzFolder() + "/poses")) IndexSeeds();
  FuzzFile("poses/photos.json", bytes);
  return Accepts([] {
    for (const CaptureView& view : ReadCapture(FuzzFolder() + "/poses").views)
      FuzzRequire(
          std::filesystem::path(view.path).parent_path() == FuzzFolder() + "/poses/photos",
          "photos lie in their folder");
  });
}

// --- camera_path.json

std::vector<std::string> PathSeeds() { return {DumpJson(SomeKeyframes())}; }

bool ReadPath(std::string_view bytes) {
  return Accepts([bytes] {
    const KeyframePath path = ParseKeyframePath(bytes, "camera_path.json");
    for (const double part : {0.0, 0.3, 0.5, 1.0}) {
      const Keyframe key = path.At(part * path.Seconds());
      const Camera camera = CameraOfKeyframe(key, 64, 48, NdcSpace());
      FuzzRequire(std::abs(Norm(camera.Forward()) - 1) < 1e-9 &&
                      std::abs(Dot(camera.Forward(), camera.Up())) < 1e-9 &&
                      std::isfinite(Norm(camera.Center())) && camera.fx > 0,
                  "every moment has a camera");
      double sum = 0;
      for (const double weight : key.weights) sum += weight;
      FuzzRequire(sum <= 1 + 1e-9, "weights can be mixed");
    }
  });
}

}  // namespace

std::vector<FuzzTarget> RecordTargets() {
  return {{"transforms_json", TransformsSeeds, ReadTransforms, MutateJson},
          {"run_json", RunSeeds, ReadRun, MutateJson, 5000},
          {"stage_record", RecordSeeds, ReadRecord, MutateJson, 25000},
          {"camera_path", PathSeeds, ReadPath, MutateJson, 3000},
          {"capture_index", IndexSeeds, ReadIndex, MutateJson}};
}

}  // namespace regrade::testing
