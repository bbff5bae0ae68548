#include "pipeline/capture/transforms_source.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "pipeline/capture/transforms_json.h"
#include "pipeline/files/text.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr char kTrainTransforms[] = "transforms_train.json";
constexpr char kTestTransforms[] = "transforms_test.json";

// The deepest folder that holds all pictures of the frames.
fs::path CommonFolder(const fs::path& root, const std::vector<TransformsFrame>& frames) {
  fs::path common;
  for (const TransformsFrame& frame : frames) {
    const fs::path parent = (root / frame.file).lexically_normal().parent_path();
    if (common.empty()) {
      common = parent;
      continue;
    }
    const auto differ =
        std::mismatch(common.begin(), common.end(), parent.begin(), parent.end()).first;
    fs::path shared;
    for (auto part = common.begin(); part != differ; ++part) shared /= *part;
    common = shared;
  }
  return common;
}

// Folders beside the capture from which pictures, masks or depths are taken.
std::vector<std::string> FoldersBeside(const std::vector<TransformsFrame>& frames) {
  std::set<std::string> folders;
  for (const TransformsFrame& frame : frames)
    for (const std::string& file : {frame.file, frame.mask, frame.depth})
      if (file.starts_with("../")) folders.insert(fs::path(file).parent_path().string());
  return {folders.begin(), folders.end()};
}

void AddNotes(const TransformsFile& file, CaptureSource* source) {
  std::vector<std::string>& notes = source->notes;
  if (const auto folders = FoldersBeside(file.frames); !folders.empty())
    notes.push_back("pictures are taken from " + Join(folders, ", ") + ", beside the capture");
  if (file.renamed > 0)
    notes.push_back(Concat(
        file.renamed, " pictures have other names than in the poses: ", file.real_name,
        " is taken for \"", file.listed_name, "\"", (file.renamed > 1 ? ", and so on" : "")));
  if (!file.missing_masks.empty())
    notes.push_back(Concat("the masks of ", file.missing_masks.size(),
                           " photos are missing: ", file.missing_masks[0],
                           (file.missing_masks.size() > 1 ? " and others" : ""),
                           "; all of these photos is learned"));
  if (!file.missing_depths.empty())
    notes.push_back(Concat("the depths of ", file.missing_depths.size(),
                           " photos are missing: ", file.missing_depths[0],
                           (file.missing_depths.size() > 1 ? " and others" : "")));
  if (!file.left.empty())
    notes.push_back(Concat(file.left.size(),
                           " photos are neither for training nor for tests and are left out: ",
                           *file.left.begin(), (file.left.size() > 1 ? " and others" : "")));
}

}  // namespace

CaptureSource TransformsSource(const fs::path& root) {
  std::error_code error;
  fs::path path = root / "transforms.json";
  if (!fs::is_regular_file(path, error)) path = root / kTrainTransforms;
  if (!fs::is_regular_file(path, error)) return {};
  const auto unknown_size = [](const std::string&, int* width, int* height) {
    *width = *height = 0;
  };
  TransformsFile file = ReadTransformsJson(path.string(), unknown_size);
  CaptureSource source{CaptureKind::kTransforms, "", path.string()};
  const fs::path test_path = root / kTestTransforms;
  if (path.filename() == kTrainTransforms && fs::is_regular_file(test_path, error)) {
    const TransformsFile tests = ReadTransformsJson(test_path.string(), unknown_size, true);
    if (!tests.frames.empty()) source.test_poses = test_path.string();
    for (const TransformsFrame& frame : tests.frames) {
      if (std::ranges::find(file.frames, frame.file, &TransformsFrame::file) !=
          file.frames.end())
        throw InputError("\"" + frame.file + "\" is for training and for tests",
                         test_path.string(), "list it in one of the two files");
      file.test.insert(frame.file);
    }
    file.frames.insert(file.frames.end(), tests.frames.begin(), tests.frames.end());
  }
  source.depth_unit = file.depth_unit;
  const fs::path photos = CommonFolder(root, file.frames);
  source.photos = photos.string();
  for (const TransformsFrame& frame : file.frames) {
    if (file.left.contains(frame.file)) continue;
    const std::string name =
        (root / frame.file).lexically_normal().lexically_relative(photos).generic_string();
    source.only.insert(name);
    if (file.test.contains(frame.file)) source.test.insert(name);
    if (!frame.mask.empty())
      source.masks[name] = (root / frame.mask).lexically_normal().string();
    if (!frame.depth.empty())
      source.depths[name] = (root / frame.depth).lexically_normal().string();
  }
  AddNotes(file, &source);
  return source;
}

}  // namespace regrade
